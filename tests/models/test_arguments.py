"""Arguments of a wrong kind are refused with the kind given, the one expected and the fix."""

import subprocess
import sys

# Run without the hook that checks annotations, as a user runs it.
INVALID_CALLS = """
import sys
import numpy as np
import pilotfish as pf
from pilotfish.models import Given

rng = np.random.default_rng(0)
demos = pf.store.synthetic_valve(rng)[:3]
fit = pf.learn(demos, states=3, rng=rng)
here = pf.adapt(fit.skill, demos[0].frames)
x0 = demos[0].x[0]
reference = pf.plan(here, x0, horizon=20)
system = pf.control.double_integrator(7, 0.1)
stream = pf.online.online_model(pf.online.DPGMM(1.0, 0.1), pf.demonstrations.position_layout(3), 0.1)
mistakes = {
    "start as a list": (lambda: pf.plan(here, list(x0), horizon=9), "np.array(start)"),
    "start in a row": (lambda: pf.plan(here, x0[None], horizon=9), "(1, 14)"),
    "skill not adapted": (lambda: pf.plan(fit.skill, x0, horizon=9), "pf.adapt"),
    "fractional horizon": (lambda: pf.plan(here, x0, horizon=9.5), "whole number"),
    "slack as text": (lambda: pf.plan(here, x0, horizon=9, slack="a"), "covariance_regularisation"),
    "effort as text": (lambda: pf.track(system, reference, effort="9"), "control_cost"),
    "effort as a list": (lambda: pf.track(system, reference, effort=[1.0] * 7), "control_cost"),
    "effort of each input": (lambda: pf.track(system, reference, effort=np.ones(7)), "np.diag"),
    "another period": (lambda: pf.track(pf.control.double_integrator(7, 1.0), reference, effort=9.0), "every 0.1 s"),
    "plan instead of reference": (lambda: pf.track(system, here, effort=9.0), "pf.plan"),
    "fractional axes": (lambda: pf.control.double_integrator(7.0, 0.1), "whole number"),
    "fractional states": (lambda: pf.learn(demos, states=3.5, rng=rng), "whole number"),
    "a seed": (lambda: pf.learn(demos, states=3, rng=0), "default_rng"),
    "structure by name": (lambda: pf.learn(demos, states=3, rng=rng, structure="full"), "pf.structures.Full()"),
    "structure's class": (lambda: pf.learn(demos, states=3, rng=rng, structure=pf.structures.SemiTied), "pf.structures.Full()"),
    "start's class": (lambda: pf.learn(demos, states=3, rng=rng, start=pf.models.KMeans), "pf.models.KMeans()"),
    "one demonstration": (lambda: pf.learn(demos[0], states=3, rng=rng), "list"),
    "arrays": (lambda: pf.learn([d.x for d in demos], states=3, rng=rng), "pf.demonstration"),
    "a fit": (lambda: pf.adapt(fit, demos[0].frames), "fit.skill"),
    "one frame": (lambda: pf.adapt(fit.skill, demos[0].frames[0]), "list of frames"),
    "a demonstration for frames": (lambda: pf.adapt(fit.skill, demos[0]), ".frames"),
    "given restarts": (lambda: pf.learn(demos, states=3, rng=rng, start=Given(fit.markov),
                                        settings=pf.models.EMSettings(restarts=2)), "restarts"),
    "tying as text": (lambda: pf.structures.SemiTied("a"), "tying"),
    "factors as text": (lambda: pf.structures.MFA("4"), "factors"),
    "half a component": (lambda: pf.gaussians.structures.MPPCA(1.5), "components"),
    "a share as dimension": (lambda: pf.structures.HDDC(0.95), "dimensions"),
    "fractional directions": (lambda: pf.gaussians.structures.EMLLT(20.0), "directions"),
    "online settings by name": (lambda: pf.online.online_model("sosc", demos[0].layout, 0.1), "SOSC("),
    "upkeep as a number": (lambda: pf.online.DPGMM(1.0, 0.1, upkeep=3), "Upkeep("),
    "weighting's class": (lambda: pf.online.Upkeep(weighting=pf.online.Count), "Count()"),
    "a penalty as text": (lambda: pf.online.DPGMM("1", 0.1), "cluster"),
    "text as a datapoint": (lambda: pf.online.observe(stream, "text"), "not real numbers"),
    "a gap in a datapoint": (lambda: pf.online.observe(stream, [1.0, None, 2.0]), "not real numbers"),
    "a demonstration as an array": (
        lambda: pf.online.observe_demonstration(stream, demos[0].x),
        "pf.demonstration",
    ),
    "fractional transforms": (lambda: pf.gaussians.structures.MLT(2.0), "transforms"),
}
for name, (mistake, words) in mistakes.items():
    try:
        mistake()
    except pf.InvalidInput as error:
        if words not in str(error):
            sys.exit(f"{name}: {error}")
    except Exception as error:
        sys.exit(f"{name}: {error!r}")
    else:
        sys.exit(f"{name}: accepted")
print(len(mistakes))
"""


def test_argument_of_wrong_type_error_names_the_fix():
    ran = subprocess.run([sys.executable, "-c", INVALID_CALLS], check=False, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    assert int(ran.stdout) > 20
