import sys; sys.path.insert(0,'/tmp/w/kh')
from proto import captured, widened
import numpy as np, time
from pathlib import Path
from encoders import naive, KNOWN_RATIOS, ROUNDED, timed
from monodyn.estimation.record.tables import read_poses
from monodyn.estimation.verdict.combinations import combinations
from monodyn.estimation.verdict import repeating as R
mech=naive('double'); n=0; tot=0
o=R._strengths
def st(*a):
    r=o(*a); print('   strengths',r[0][[0,-1]],'loglik %.1f'%r[1]); return r
if len(sys.argv)>2: R._strengths=st
for f in sorted(Path('/work/shared/data/encoders').glob('double*.csv'))[::int(sys.argv[1])]:
    captured.clear(); t=timed(f.stem,[read_poses(f,mech)],mech); found=captured[-1]
    t0=time.perf_counter(); more=R.repeating(found); dt=time.perf_counter()-t0
    cs={c.name:(c.value,c.std) for c in combinations(found.problem,found.optimum.x,widened(found,more),1.96,None)}
    row={c.name:(c.value,c.std) for c in t.fit.combinations}
    ok=[abs(cs[k][0]-v)<=1.96*cs[k][1]+ROUNDED[k] for k,v in KNOWN_RATIOS.items()]; n+=sum(ok); tot+=4
    print(f.stem,'%.2f s'%dt,ok,' '.join('%+.3f%% %.3f->%.3f'%(100*(row[k][0]/v-1),100*row[k][1]/v,100*cs[k][1]/v) for k,v in KNOWN_RATIOS.items()),flush=True)
print(n,tot)
