% Execute a .m file, and answer what its names are and what its functions return: the protocol of answers_runner.py.
% Names are answered as text where the symbolic package is installed; functions are called with numbers alone.
1;

function say(answers, message)
  fprintf(answers, "%s\n", jsonencode(message));
  fflush(answers);
end

function message = failed(message, err, name)
  message.error = err.message;
  message.line = [];
  for k = numel(err.stack):-1:1
    [~, file] = fileparts(err.stack(k).file);
    if strcmp(file, name)
      message.line = err.stack(k).line;
    end
  end
end

% The functions of a file: names, arguments and results, out of their first lines.
function found = functions_of(text)
  pattern = '^[ \t]*function\s+(?:(\[[^\]\n]*\]|\w+)\s*=\s*)?(\w+)\s*(\([^)\n]*\))?';
  [tokens, starts] = regexp(text, pattern, "tokens", "start", "lineanchors");
  found = {};
  for k = 1:numel(tokens)
    one = [repmat({""}, 1, 3 - numel(tokens{k})), tokens{k}];
    if numel(tokens{k}) == 2 && tokens{k}{2}(1) == "("
      one = {"", tokens{k}{:}};
    end
    if numel(tokens{k}) == 2 && tokens{k}{2}(1) != "("
      one = {tokens{k}{:}, ""};
    end
    if numel(tokens{k}) == 1
      one = {"", tokens{k}{1}, ""};
    end
    names = regexp(one{3}, '[A-Za-z]\w*', "match");
    results = regexp(one{1}, '[A-Za-z]\w*', "match");
    line = 1 + sum(text(1:starts(k)) == "\n");
    found{end+1} = struct("name", one{2}, "line", line, "parameters", {names}, "locals", {results});
  end
end

% A value as rows of text; only the symbolic package has formulas.
function tree = tree_of(value)
  if isnumeric(value) && isreal(value)
    text = arrayfun(@(x) sprintf("%.15g", x), double(value), "UniformOutput", false);
  elseif isa(value, "sym")
    text = cell(size(value));
    for k = 1:numel(value)
      text{k} = char(value(k));
    end
  else
    tree = struct("error", ["found " class(value) "; expected formulas or numbers"]);
    return;
  end
  if numel(text) == 1
    tree = text{1};
    return;
  end
  tree = cell(1, rows(text));
  for i = 1:rows(text)
    tree{i} = text(i, :);
  end
  if columns(text) == 1
    tree = reshape(text, 1, []);
  end
end

function value = argument(value)
  if isnumeric(value)
    value = double(value(:));
  end
end

function values = sampled(request, functions)
  of = functions{cellfun(@(f) strcmp(f.name, request.call), functions)};
  place = 1;
  if ! isempty(request.local)
    place = find(strcmp(of.locals, request.local));
  end
  samples = request.samples;
  values = cell(1, numel(samples));
  for k = 1:numel(samples)
    if iscell(samples)
      one = samples{k};
    else
      one = samples(k);
    end
    given = cellfun(@argument, struct2cell(one), "UniformOutput", false);
    results = cell(1, place);
    [results{:}] = feval(request.call, given{:});
    result = double(results{place});
    if ! isreal(result)
      error("returned complex numbers; expected real ones");
    end
    result(! isfinite(result)) = NaN;
    values{k} = num2cell_rows(result);
  end
end

function tree = num2cell_rows(result)
  if numel(result) == 1
    tree = result;
  else
    tree = cell(1, rows(result));
    for i = 1:rows(result)
      tree{i} = num2cell(result(i, :));
    end
  end
end

dhkit_path = argv(){end};
[dhkit_folder, dhkit_name] = fileparts(dhkit_path);
dhkit_requests = fopen("/dev/fd/3", "r");
dhkit_answers = fopen("/dev/fd/4", "w");
addpath(dhkit_folder);
dhkit_functions = functions_of(fileread(dhkit_path));
try
  pkg load symbolic
catch
end
try
  source(dhkit_path);
catch err
  say(dhkit_answers, failed(struct(), err, dhkit_name));
  exit(0);
end
dhkit_names = struct();
for dhkit_one = who()'
  if ! strncmp(dhkit_one{1}, "dhkit_", 6) && ! any(strcmp(dhkit_one{1}, {"ans", "err"}))
    dhkit_names.(dhkit_one{1}) = 0;
  end
end
say(dhkit_answers, struct("functions", {dhkit_functions}, "names", dhkit_names));
while ischar(dhkit_line = fgetl(dhkit_requests))
  if isempty(dhkit_line)
    continue;
  end
  dhkit_request = jsondecode(dhkit_line, "makeValidName", false);
  dhkit_message = struct("id", dhkit_request.id);
  try
    if isfield(dhkit_request, "value")
      dhkit_message.tree = tree_of(eval(dhkit_request.value));
    else
      dhkit_message.values = sampled(dhkit_request, dhkit_functions);
    end
  catch err
    dhkit_message = failed(dhkit_message, err, dhkit_name);
  end
  say(dhkit_answers, dhkit_message);
end
