% Answer requests with the functions of a .m file: docs/own-code.md has the protocol.
% The file is a script that defines functions, or a function file.
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

path = argv(){end};
[folder, name] = fileparts(path);
requests = fopen("/dev/fd/3", "r");
answers = fopen("/dev/fd/4", "w");
addpath(folder);
known = {"fk", "ik", "controller"};
try
  if ! any(strcmp(name, known))
    source(path);
  end
catch err
  say(answers, failed(struct(), err, name));
  exit(0);
end
found = known(cellfun(@(f) any(exist(f) == [2 103]), known));
fprintf(answers, "{\"functions\": [%s]}\n", strjoin(cellfun(@(f) ["\"" f "\""], found, "UniformOutput", false), ", "));
fflush(answers);
while ischar(text = fgetl(requests))
  if isempty(text)
    continue;
  end
  request = jsondecode(text, "makeValidName", false);
  message = struct("id", request.id);
  try
    values = struct2cell(request.arguments);
    result = feval(request.call, values{:});
    if isempty(result)
      result = [];
    elseif ! isnumeric(result) || ! isreal(result)
      error("returned %s; expected real numbers", class(result));
    end
    result(! isfinite(result)) = NaN;
    message.value = double(result);
  catch err
    message = failed(message, err, name);
  end
  say(answers, message);
end
