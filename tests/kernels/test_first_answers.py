"""How soon the first answers come: of an arm that nothing is known of, with an empty cache, in a new process."""

import json
import os
import subprocess
import sys

import pytest

from acceptance import ACCEPTING, only_accepting

ARM = """
from time import perf_counter
start = perf_counter()
import json, sys
import numpy as np, dhkit
arm = dhkit.Arm.from_dh(
    [(0, 0.33, 0.01, "-pi/2"), (0, 0.02, 0, "pi/2"), (0, 0.32, 0.08, 1.3), (0, 0.01, -0.08, "-pi/2"),
     (0, 0.38, 0, 1.2), (0, 0, 0.09, "pi/2"), (0, 0.11, 0.05, 0.3)], name="seven",
).with_uniform_links([4, 3, 3, 2, 2, 1, 0.5])
seen, q, qd = {}, np.full(7, 0.1), np.full(7, 0.2)
def first(name, call):
    begin = start if not seen else perf_counter()
    result = call()
    seen[name] = perf_counter() - begin
    return result
"""
FIRST = """
T = first("fk", lambda: arm.fk(q))
first("jacobian", lambda: arm.jacobian(q))
first("mass_matrix", lambda: arm.mass_matrix(q))
first("inverse_dynamics", lambda: arm.inverse_dynamics(q, qd, qd))
first("forward_dynamics", lambda: arm.forward_dynamics(q, qd, qd))
first("coriolis_matrix", lambda: arm.coriolis_matrix(q, qd))
first("ik_numeric", lambda: arm.ik_numeric(T))
first("gravity_torque", lambda: arm.gravity_torque(q))
assert first("verify", lambda: arm.verify(samples=10)).ok
seen["all"] = perf_counter() - start
print(json.dumps(seen))
"""
CALLS = """
def least(call, times):
    call()
    found = []
    for _ in range(50):
        begin = perf_counter()
        for _ in range(times):
            call()
        found.append((perf_counter() - begin) / times)
    return min(found)
Q = np.random.default_rng(0).uniform(-1, 1, (1000, 7))
seen["fk, a call"] = least(lambda: arm.fk(q), 1000)
seen["inverse_dynamics, a call"] = least(lambda: arm.inverse_dynamics(q, qd, qd), 1000)
seen["fk, an item of 1,000"] = least(lambda: arm.fk(Q), 1) / 1000
seen["inverse_dynamics, an item of 1,000"] = least(lambda: arm.inverse_dynamics(Q, Q, Q), 1) / 1000
print(json.dumps(seen))
"""
STALL = """
import threading
longest = 0.0
calls = [lambda: arm.fk(q), lambda: arm.inverse_dynamics(q, qd, qd), lambda: arm.mass_matrix(np.tile(q, (63, 1)))]
for call in calls:
    call()
Q = np.random.default_rng(0).uniform(-1, 1, (100_000, 7))
def large():
    arm.fk(Q), arm.inverse_dynamics(Q, Q, Q), arm.mass_matrix(Q), arm.coriolis_matrix(Q, Q), arm.compile()
busy = threading.Thread(target=large)
busy.start()
while busy.is_alive():
    for call in calls:
        begin = perf_counter()
        call()
        longest = max(longest, perf_counter() - begin)
print(json.dumps({"longest": longest}))
"""
WARM = """
from time import perf_counter
start = perf_counter()
import json, sys
import numpy as np, dhkit
dhkit.Arm.load("puma560").fk(np.zeros((10_000, 6)))
seconds = perf_counter() - start
print(json.dumps({"seconds": seconds, "numba": "numba" in sys.modules, "casadi": "casadi" in sys.modules}))
"""


def measured(code, folder):
    environment = {**os.environ, "DHKIT_CACHE_DIR": str(folder), "DHKIT_KERNELS": "auto"}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.slow
def test_the_first_answer_of_each_kind(law, tmp_path):
    law.samples(1)
    required = {"fk": 0.5, "verify": 0.6, "all": 3.0}
    for name, seconds in measured(ARM + FIRST, tmp_path).items():
        law.takes(f"seconds to the first {name}", seconds, required.get(name, 0.3))
    assert not list(tmp_path.rglob("*.kernel")), "single states started a compilation"


@only_accepting
@pytest.mark.slow
def test_single_states_and_small_batches(law, tmp_path):
    law.samples(1)
    required = {"fk, a call": 6e-6, "inverse_dynamics, a call": 9e-6}
    for name, seconds in measured(ARM + CALLS, tmp_path).items():
        law.takes(f"seconds: {name}", seconds, required.get(name, 1.5e-6))


@only_accepting
@pytest.mark.slow
def test_no_small_batch_waits_for_the_compiler(law, tmp_path):
    law.samples(1)
    law.takes(
        "longest call beside a thread that compiles, s",
        measured(ARM + STALL, tmp_path)["longest"],
        0.05,
    )


@pytest.mark.slow
def test_a_warm_process(law, tmp_path):
    law.size = 5 if ACCEPTING else 1
    measured("import json, dhkit; dhkit.Arm.load('puma560').compile(); print('{}')", tmp_path)
    for _ in range(law.size):
        seen = measured(WARM, tmp_path)
        assert not seen["numba"]
        assert not seen["casadi"]
        law.takes("seconds of a new process to 10,000 poses", seen["seconds"], 0.45)
