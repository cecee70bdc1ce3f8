import sys, json, numpy as np, pickle
from pathlib import Path
import monodyn
from monodyn.estimation.verdict import summary, gravity
from monodyn.estimation.verdict.combinations import combinations
from monodyn.estimation.verdict.unmodelled import noise_of_rows as _noise_of_rows
from monodyn.mechanism.simulate import transitions
from monodyn.mechanism.torques import LAG
from monodyn.estimation.verdict.uncertainty import Knowledge
from dataclasses import replace
captured=[]
orig=summary.gravity_share
def grab(found):
    captured.append(found); return orig(found)
summary.gravity_share=grab

def responses(problem, trial, F, seed=0, ell=1.0):
    """(row,dof,dof*F): residual change per unit coefficient."""
    data, mechanism = problem.data, problem.mechanism_at(trial.x)
    clock = data.times*problem.stretch(trial.x)
    q = problem.simulated(trial) if False else None
    lag, stretch = mechanism.values.get(LAG,0.0), problem.stretch(trial.x)
    rng=np.random.default_rng(seed)
    out=[]
    from monodyn.mechanism.simulate import rollout
    states=[]; trans=[]
    for first,stop,state in trial.runs:
        drive=problem.driven(mechanism.drive,lag,stretch,first,stop)
        trans.append(transitions(mechanism.tree,clock[first:stop],state,substeps=trial.substeps,drive=drive))
        qq,vv=rollout(mechanism.tree,clock[first:stop],*np.split(state,2),substeps=trial.substeps,drive=drive)
        states.append((qq,vv))
    Q=np.concatenate([s[0] for s in states]); V=np.concatenate([s[1] for s in states])
    dofs=Q.shape[1]
    slide=np.atleast_2d(data.slide)[0]
    x=[]
    for j in range(dofs):
        if slide[j]: x.append(Q[:,j]/np.std(Q[:,j]))
        else: x+= [np.cos(Q[:,j]),np.sin(Q[:,j])]
    x+= [V[:,j]/np.sqrt(np.mean(V[:,j]**2)) for j in range(dofs)]
    x=np.stack(x,1)/ell
    res=np.zeros((len(Q),dofs,dofs*F))
    for j in range(dofs):
        w=rng.normal(size=(x.shape[1],F)); b=rng.uniform(0,2*np.pi,F)
        phi=np.sqrt(2.0/F)*np.cos(x@w+b)
        at=0
        for (first,stop,_),t in zip(trial.runs,trans):
            e=np.zeros((2*dofs,F))
            for i in range(first+1,stop):
                h=clock[i]-clock[i-1]; a=0.5*(phi[i]+phi[i-1])
                e=t[i-first]@e
                e[j]+=a*h*h/2; e[dofs+j]+=a*h
                res[i,:,j*F:(j+1)*F]=e[:dofs]
    return res

def discrepancy(found, F=48, ell=1.0, ml=True):
    problem, optimum = found.weighted, found.optimum
    trial=optimum.trial
    unit=problem.data.by_row(np.where(problem.data.slide, problem.size(trial.x),1.0))
    unit=np.broadcast_to(unit,problem.data.position.shape)
    R=responses(problem,trial,F,ell=ell)/unit[...,None]
    _,J=problem.rows(trial)
    data=problem.data
    count=len(trial.x)
    # white noise of rows from the stated problem
    resid=problem.differences(trial)
    white=_noise_of_rows(resid*unit, np.where(data.measured,found.problem.data.std,np.nan)*unit)/unit
    dofs=resid.shape[1]
    # weights of the fit: rows = white_matrix @ diff ; whitened response
    Wm=data.white
    Rw=np.einsum('fij,fjk->fik',Wm,R)
    Rw[~data.measured]=0
    # parameter gains: projected
    gain=np.zeros((count,R.shape[2]))
    proj=[]; 
    for first,stop in zip(trial.pieces.first[:-1],trial.pieces.first[1:]):
        rows=J[first:stop].reshape(-1,J.shape[2])
        sh,st=rows[:,:count],rows[:,count:]
        qm,_=np.linalg.qr(st)
        rr=Rw[first:stop].reshape(-1,R.shape[2])
        shp=sh-qm@(qm.T@sh)
        gain+=shp.T@rr
        proj.append((rr-qm@(qm.T@rr),shp))
    shift=-found.known.covariance@gain    # sign irrelevant
    # residual response after fit (whitened), removing shared too
    left=np.concatenate([p[0] for p in proj])+np.concatenate([p[1] for p in proj])@shift
    rw=np.einsum('fij,fj->fi',Wm,np.nan_to_num(resid)); rw[~data.measured]=0
    rw=rw.ravel()
    # white level in whitened units
    lev=np.nan_to_num(white/ (1/np.sqrt(np.einsum('fii->fi',Wm)**2)),nan=1.0)
    lev=np.where(data.measured, white*np.einsum('fii->fi',Wm),1.0).ravel()
    A=left/lev[:,None]; y=rw/lev
    use=data.measured.ravel()
    A=A[use]; y=y[use]
    # ML over s_j by EM-ish grid coordinate
    G=A.T@A; g=A.T@y; K=len(g)//dofs
    def nll(s):
        d=np.repeat(s,K)
        M=np.eye(len(g))+ (d[:,None]*G*d[None])
        L=np.linalg.cholesky(M)
        u=np.linalg.solve(L,d*g)
        return np.log(np.diag(L)).sum()-0.5*u@u
    scale=np.sqrt(np.array([y@y/np.trace(G[j*K:(j+1)*K,j*K:(j+1)*K]) for j in range(dofs)]))
    grid=np.concatenate([[0],10.0**np.arange(-2,3.01,0.125)])
    s=scale*0.3
    for _ in range(4):
        for j in range(dofs):
            vals=[]
            for f in grid:
                t=s.copy(); t[j]=f*scale[j]; vals.append(nll(t))
            s[j]=grid[int(np.argmin(vals))]*scale[j]
    d=np.repeat(s,K)
    more=(shift*d)@(shift*d).T
    # bias of posterior mean of c
    M=np.eye(len(g))+(d[:,None]*G*d[None])
    chat=d*np.linalg.solve(M,d*g)
    explained=1-np.sum((y-A@chat)**2)/np.sum(y**2)
    return s, more, shift@chat, explained, np.sqrt(np.mean(y**2)), np.sqrt(np.mean((y-A@chat)**2))

def widened(found, more):
    k=found.known
    std=np.where(np.isinf(k.std),np.inf,np.sqrt(np.diag(k.covariance+more)))
    return Knowledge(k.covariance+more,k.open,k.relative,std,k.full)
