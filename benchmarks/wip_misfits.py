import sys; sys.path.insert(0,'/tmp/w/kh'); sys.path.insert(0,'/tmp/wt/rep/tests')
from proto import captured, widened
import numpy as np
from dataclasses import replace
import monodyn
from monodyn.estimation.verdict import repeating as R
from monodyn.estimation.verdict.combinations import combinations, inertial_ratios
from swings import motion, record
from monodyn.mechanism import load
from monodyn.estimation.settings import IdentifySettings
times=np.arange(120)/60.0
for kind in ('dry','drag'):
    z0=[];z1=[]
    for seed in range(8):
        rng=np.random.default_rng(seed)
        base=load('double')
        extra={'joint1.friction':2e-3,'joint2.friction':1e-3} if kind=='dry' else {'joint1.drag':3e-4,'joint2.drag':2e-4}
        truth=base.with_values(extra)
        q=motion(truth,times,[-0.4+.5*rng.normal(),.6*rng.normal()],[0,0])
        p=record(truth,times,q,noise=2e-4,seed=seed)
        captured.clear()
        fit=monodyn.identify(p,base.with_choices(fix={k:0.0 for k in extra}),IdentifySettings(torque='friction'))
        found=captured[-1]; more=R.repeating(found)
        cs={c.name:c for c in combinations(found.problem,found.optimum.x,widened(found,more),1.96,None)}
        tr={k:float(np.real(v)) for k,v in inertial_ratios(truth,truth.tree,full=True).items()}
        for c in fit.combinations:
            if c.name in tr and c.name in cs and 'J' in c.name:
                z0.append((c.value-tr[c.name])/c.std); z1.append((c.value-tr[c.name])/cs[c.name].std)
        print(kind,seed,fit.grade,fit.unmodelled is not None,'z before rms %.1f after %.2f'%(np.sqrt(np.mean(np.square(z0[-5:]))),np.sqrt(np.mean(np.square(z1[-5:])))),flush=True)
    print(kind,'all: before rms %.2f hold %.0f %%, after rms %.2f hold %.0f %%'%(np.sqrt(np.mean(np.square(z0))),100*np.mean(np.abs(z0)<2),np.sqrt(np.mean(np.square(z1))),100*np.mean(np.abs(z1)<2)))
