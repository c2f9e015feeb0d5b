#include "latinimpl.h"

/*
   Dynamics of section 2.2, and how one time step becomes a problem that every solver here takes.

   With the unknown w = h v+, the implicit Euler scheme (8) of a step of length h from (u, v) reads
     M / h^2 w + B^t tau = F + M v / h,
   and the elongation of a link is e- + B w with e- = B u: (9) and (11) are the laws of statics with the prestrain
   e- + e0. So a time step is a static structure whose nodes stand on springs M / h^2 to the ground, with another load,
   another prestrain and supports at rest. It is a LatinLinks of its own, which shares the mesh and the laws with the
   structure that it is a step of, its base.

   Rigid links follow Moreau's condition (10): one that is slack, or open, when the step starts bears nothing in it; any
   other one must not be stretched, or closed, further: its law holds for w itself. Both are prestrains again, infinite
   and zero, so that operators stay as they are. What a solver leaves open of a closed contact must not open it: gaps
   count from a small part of the free flight of the step on.
*/

#define LATIN_STEP_SAME   LatinByPrecision(1e-8, 1e-5) /* relative: lengths of steps that differ by rounding are one length */
#define LATIN_STEP_FAR    PETSC_MAX_REAL               /* the gap of a link that bears nothing during a step */
#define LATIN_STEP_CLOSED 1e-4                         /* relative to the free flight of a step: smaller gaps are closed */

/*@C
  LatinLinksSetMass - Gives the nodes of this rank their masses, for dynamics.

  Collective on links

  Input Parameters:
+ links - the structure
- mass  - [nodes_local] a mass each, not negative

  Level: beginner

  Note:
  The masses are lumped (section 2.2): add half the mass of each link to both of its nodes. A node may have no mass as
  long as links with mass hold it.

.seealso: `LatinLinksAttachTS()`, `TSLATIN`
@*/
PetscErrorCode LatinLinksSetMass(LatinLinks links, const PetscReal mass[])
{
  PetscInt  bad = -1;
  PetscReal sum = 0.0;

  PetscFunctionBegin;
  PetscValidHeaderSpecific(links, LATIN_LINKS_CLASSID, 1);
  for (PetscInt i = 0; i < links->nodes_local; i++) {
    if (bad < 0 && (!(mass[i] >= 0.0) || PetscIsInfOrNanReal(mass[i]))) bad = i;
    sum += mass[i];
  }
  LatinAgree(PetscObjectComm((PetscObject)links), bad >= 0, PETSC_ERR_ARG_OUTOFRANGE, "Node %" PetscInt_FMT " has mass %g; a mass is a finite number, not negative", links->nodes_start + bad, (double)mass[bad]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &sum, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)links)));
  LatinAgree(PetscObjectComm((PetscObject)links), !(sum > 0.0), PETSC_ERR_ARG_OUTOFRANGE, "No node has a mass: nothing resists acceleration");
  if (!links->mass) PetscCall(PetscMalloc1(links->nodes_local + 1, &links->mass)); /* never NULL where there are masses */
  PetscCall(PetscArraycpy(links->mass, mass, links->nodes_local));
  PetscCall(VecDestroy(&links->inertia));
  PetscCall(PetscObjectStateIncrease((PetscObject)links));
  PetscFunctionReturn(0);
}

/* M at the free degrees of freedom */
PetscErrorCode LatinLinksInertia_Private(LatinLinks links)
{
  const PetscInt dim = links->dim;
  PetscReal     *m;

  PetscFunctionBegin;
  PetscCheck(links->set_up, PetscObjectComm((PetscObject)links), PETSC_ERR_ORDER, "The structure is not set up: call LatinLinksSetUp() after laws, supports and loads");
  PetscCheck(links->mass, PetscObjectComm((PetscObject)links), PETSC_ERR_ORDER, "The structure has no masses: call LatinLinksSetMass() (in Python, latinpc.Links(..., mass=...))");
  if (links->inertia) PetscFunctionReturn(0);
  PetscCall(PetscMalloc1(dim * links->nodes_local, &m));
  for (PetscInt i = 0; i < dim * links->nodes_local; i++) m[i] = links->mass[i / dim];
  PetscCall(DMCreateGlobalVector(links->dm, &links->inertia));
  PetscCall(LatinLinksNodalVec_Private(links, m, links->inertia));
  PetscCall(PetscFree(m));
  PetscFunctionReturn(0);
}

/* Adds the forces of the springs to the ground, G u */
PetscErrorCode LatinLinksAddGround_Private(LatinLinks links, Vec u, Vec r)
{
  const PetscScalar *g, *a;
  PetscScalar       *f;
  PetscInt           n;

  PetscFunctionBegin;
  PetscCall(VecGetLocalSize(u, &n));
  PetscCall(VecGetArrayRead(links->ground, &g));
  PetscCall(VecGetArrayRead(u, &a));
  PetscCall(VecGetArray(r, &f));
  for (PetscInt i = 0; i < n; i++) f[i] += g[i] * a[i];
  PetscCall(VecRestoreArray(r, &f));
  PetscCall(VecRestoreArrayRead(u, &a));
  PetscCall(VecRestoreArrayRead(links->ground, &g));
  PetscFunctionReturn(0);
}

/* 1/2 u^t D u for a diagonal D */
static PetscErrorCode LatinDiagonalEnergy_Private(Vec D, Vec u, PetscReal *energy)
{
  const PetscScalar *d, *a;
  PetscReal          sum = 0.0;
  PetscInt           n;

  PetscFunctionBegin;
  PetscCall(VecGetLocalSize(u, &n));
  PetscCall(VecGetArrayRead(D, &d));
  PetscCall(VecGetArrayRead(u, &a));
  for (PetscInt i = 0; i < n; i++) sum += 0.5 * d[i] * a[i] * a[i];
  PetscCall(VecRestoreArrayRead(u, &a));
  PetscCall(VecRestoreArrayRead(D, &d));
  PetscCall(MPIU_Allreduce(&sum, energy, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)u)));
  PetscFunctionReturn(0);
}

/* What the springs to the ground store */
PetscErrorCode LatinLinksGroundEnergy_Private(LatinLinks links, Vec u, PetscReal *energy)
{
  PetscFunctionBegin;
  PetscCall(LatinDiagonalEnergy_Private(links->ground, u, energy));
  PetscFunctionReturn(0);
}

/*@C
  LatinLinksComputeKineticEnergy - The kinetic energy 1/2 v^t M v of the nodes.

  Collective on links

  Input Parameters:
+ links - the structure, with masses
- v     - velocities, a DM global vector

  Output Parameter:
. energy - a force times a length

  Level: intermediate

.seealso: `LatinLinksComputeEnergy()`
@*/
PetscErrorCode LatinLinksComputeKineticEnergy(LatinLinks links, Vec v, PetscReal *energy)
{
  PetscInt n, m;

  PetscFunctionBegin;
  PetscValidHeaderSpecific(links, LATIN_LINKS_CLASSID, 1);
  PetscCall(LatinLinksInertia_Private(links));
  PetscCall(VecGetLocalSize(v, &n));
  PetscCall(VecGetLocalSize(links->inertia, &m));
  LatinAgree(PetscObjectComm((PetscObject)links), n != m, PETSC_ERR_ARG_SIZ,
             "The vector has %" PetscInt_FMT " entries on a rank where the structure has %" PetscInt_FMT " free degrees of freedom; make it with DMCreateGlobalVector() on the DM of the structure", n, m);
  PetscCall(LatinDiagonalEnergy_Private(links->inertia, v, energy));
  PetscFunctionReturn(0);
}

/* ---- a time step as a structure ---- */

/* Looks at the base again: what is shared, and whether operators must be made anew */
static PetscErrorCode LatinStepRefresh_Private(LatinLinks step)
{
  const struct _p_LatinLinks own  = *step;
  LatinLinks                 base = own.base;
  const size_t               skip = offsetof(struct _p_LatinLinks, dim);
  PetscObjectState           state;

  PetscFunctionBegin;
  PetscCall(LatinLinksInertia_Private(base));
  PetscCall(PetscMemcpy((char *)step + skip, (char *)base + skip, sizeof(own) - skip));
  step->base              = base;
  step->dm                = own.dm;
  step->load              = own.load;
  step->load_state        = own.load_state;
  step->prestrain         = own.prestrain;
  step->prestrain_state   = own.prestrain_state;
  step->prescribed        = own.prescribed;
  step->vertex_prescribed = own.vertex_prescribed;
  step->tangent           = own.tangent;
  step->ground            = own.ground;
  step->shift             = own.shift;
  if (base->rigid_law >= 0) { /* their search parameters are those of the step */
    step->stiffness = own.stiffness;
    if (!step->stiffness) PetscCall(PetscMalloc1(base->links_local, &step->stiffness));
  }
  PetscCall(PetscObjectStateGet((PetscObject)base, &state));
  step->base_state = state;
  if (state != own.base_state) step->shift = 0.0; /* laws, masses or the partition have changed */
  PetscFunctionReturn(0);
}

PetscErrorCode LatinStepCreate_Private(LatinLinks base, LatinLinks *newstep)
{
  LatinLinks   step;
  PetscSection section;

  PetscFunctionBegin;
  PetscCall(PetscHeaderCreate(step, LATIN_LINKS_CLASSID, "LatinLinks", "Time step of a structure", "Latin", PetscObjectComm((PetscObject)base), LatinLinksDestroy, ((PetscObject)base)->bops->view));
  PetscCall(PetscObjectReference((PetscObject)base));
  step->base = base;
  /* a DM of its own, as PETSc keeps callbacks there, and solvers find the structure there */
  PetscCall(DMClone(base->dm, &step->dm));
  PetscCall(DMGetLocalSection(base->dm, &section));
  PetscCall(DMSetLocalSection(step->dm, section));
  PetscCall(DMCreateDS(step->dm));
  PetscCall(VecDuplicate(base->load, &step->load));
  PetscCall(VecDuplicate(base->load, &step->ground));
  PetscCall(PetscCalloc3(base->links_local, &step->prestrain, base->dim * base->nodes_local, &step->prescribed, base->dim * base->vertices, &step->vertex_prescribed));
  PetscCall(LatinStepRefresh_Private(step));
  PetscCall(LatinLinksKnowDM_Private(step));
  *newstep = step;
  PetscFunctionReturn(0);
}

PetscErrorCode LatinStepDestroy_Private(LatinLinks step)
{
  PetscFunctionBegin;
  PetscCall(PetscObjectCompose((PetscObject)step->dm, "LatinLinks", NULL)); /* others may hold the DM */
  PetscCall(DMDestroy(&step->dm));
  PetscCall(VecDestroy(&step->load));
  PetscCall(VecDestroy(&step->ground));
  PetscCall(PetscFree3(step->prestrain, step->prescribed, step->vertex_prescribed));
  PetscCall(PetscFree(step->tangent));
  if (step->stiffness != step->base->stiffness) PetscCall(PetscFree(step->stiffness));
  PetscCall(LatinLinksDestroy(&step->base));
  PetscFunctionReturn(0);
}

/* Springs G = shift M; operators are made anew when the shift changes */
static PetscErrorCode LatinStepGround_Private(LatinLinks step, PetscReal shift)
{
  PetscFunctionBegin;
  if (PetscAbsReal(shift - step->shift) <= LATIN_STEP_SAME * shift) PetscFunctionReturn(0);
  PetscCall(VecAXPBY(step->ground, shift, 0.0, step->base->inertia));
  step->shift = shift;
  if (step->rigid_law >= 0) {
    PetscCall(PetscArraycpy(step->stiffness, step->base->stiffness, step->links_local));
    PetscCall(LatinLinksTune_Private(step));
  }
  PetscCall(PetscObjectStateIncrease((PetscObject)step));
  PetscFunctionReturn(0);
}

/* The prestrain of a link in a step that starts from the strain x = e- + e0; gaps up to `closed` are none */
static PetscReal LatinStepPrestrain(PetscInt law, PetscReal x, PetscReal closed)
{
  if (!LatinLaws[law].rigid) return x; /* (9), (11) */
  if (law == LATIN_LAW_INEXTENSIBLE) return x < -closed ? -LATIN_STEP_FAR : 0.0;
  if (law == LATIN_LAW_TANGENT) return 0.0; /* friction opposes the velocity */
  return x > closed ? LATIN_STEP_FAR : 0.0;
}

/* The largest displacement of a node that no link holds during the step */
static PetscErrorCode LatinStepFlight_Private(LatinLinks step, PetscReal *flight)
{
  Vec w;

  PetscFunctionBegin;
  PetscCall(DMGetGlobalVector(step->dm, &w));
  PetscCall(VecPointwiseDivide(w, step->load, step->ground));
  PetscCall(VecNorm(w, NORM_INFINITY, flight));
  PetscCall(DMRestoreGlobalVector(step->dm, &w));
  PetscFunctionReturn(0);
}

/* The step of length h from (u, v); its unknown is h v+. Collective on step */
PetscErrorCode LatinStepStart_Private(LatinLinks step, PetscReal h, Vec u, Vec v)
{
  LatinLinks base   = step->base;
  PetscReal  flight = 0.0;

  PetscFunctionBegin;
  PetscCheck(h > 0.0 && h * h > 0.0 && !PetscIsInfOrNanReal(1.0 / (h * h)), PetscObjectComm((PetscObject)step), PETSC_ERR_ARG_OUTOFRANGE,
             "A time step has the length %g; it is a positive time of which 1 / h^2 is a number: give another one with -ts_dt", (double)h);
  PetscCall(LatinStepRefresh_Private(step));
  PetscCall(LatinStepGround_Private(step, 1.0 / (h * h)));
  PetscCall(VecPointwiseMult(step->load, base->inertia, v));
  PetscCall(VecAYPX(step->load, 1.0 / h, base->load));
  step->load_state++;
  if (base->rigid_law >= 0) PetscCall(LatinStepFlight_Private(step, &flight));
  PetscCall(LatinLinksElongations_Private(base, u, step->prestrain));
  for (PetscInt l = 0; l < base->links_local; l++) step->prestrain[l] = LatinStepPrestrain(base->law[l], step->prestrain[l] + base->prestrain[l], LATIN_STEP_CLOSED * flight);
  step->prestrain_state++;
  PetscCall(PetscArrayzero(step->prescribed, base->dim * base->nodes_local));
  PetscCall(PetscArrayzero(step->vertex_prescribed, base->dim * base->vertices));
  PetscFunctionReturn(0);
}

/* The operators of steps of which 1 / h^2 is known, before the first one; 0: it is not. Collective on step */
PetscErrorCode LatinStepLength_Private(LatinLinks step, PetscReal shift)
{
  PetscFunctionBegin;
  PetscCall(LatinStepRefresh_Private(step));
  if (shift > 0.0) PetscCall(LatinStepGround_Private(step, shift));
  PetscFunctionReturn(0);
}

/* The base itself, its displacements the unknown, on springs shift M: what other integrators linearise. Collective on step */
PetscErrorCode LatinStepShift_Private(LatinLinks step, PetscReal shift)
{
  LatinLinks base = step->base;

  PetscFunctionBegin;
  PetscCall(LatinStepRefresh_Private(step));
  PetscCall(LatinStepGround_Private(step, shift));
  PetscCall(VecCopy(base->load, step->load));
  step->load_state++;
  PetscCall(PetscArraycpy(step->prestrain, base->prestrain, base->links_local));
  step->prestrain_state++;
  PetscCall(PetscArraycpy(step->prescribed, base->prescribed, base->dim * base->nodes_local));
  PetscCall(PetscArraycpy(step->vertex_prescribed, base->vertex_prescribed, base->dim * base->vertices));
  PetscFunctionReturn(0);
}
