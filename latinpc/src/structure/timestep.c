#include "structure/structureimpl.h"

/*
   Dynamics of section 2.2: a time step as a static problem, for all solvers.

   With the unknown w = h v+, the implicit Euler scheme (8) of a step of length h from (u, v) reads
     M / h^2 w + B^t tau = F + M v / h,
   and the elongation of a link is e- + B w with e- = B u: (9) and (11) are the laws of statics with the initial elongation e- + e0. So a time step is a
   static structure with springs M / h^2 between nodes and the ground, another load, other initial elongations, and the increments of prescribed
   displacements. It is a LatinStructure of its own, which shares mesh and laws with its base, the structure in motion.

   Rigid links are no exception: at the end of the step contacts must not be closed, nor inextensible cables stretched, by more than at its start. This is
   (3), to which (11) tends for large stiffnesses. Moreau's condition (10) tests gaps at the start of the step instead, so that contacts overlap by the
   way of a step. What overlaps at the start may stay so: to push it apart would add energy. Nor must grains at rest move by the error of a solver: gaps
   count as closed up to LATIN_STEP_CLOSED of the flight, the largest displacement of the step without rigid links.
*/

#define LATIN_STEP_SAME   LatinByPrecision(1e-8, 1e-5) /* largest relative difference, by rounding, of equal 1 / h^2 */
#define LATIN_STEP_CLOSED 1e-4                         /* largest gap of closed contacts, relative to the flight; with 4e-4 two motions of the catalogue fail */

/*@C
  LatinStructureSetMass - Sets the masses of the nodes of this rank, [nodes_local], >= 0, for dynamics.

  Collective on structure

  Input Parameters:
+ structure - the structure
- mass      - [nodes_local] masses, not negative

  Level: beginner

  Note:
  Masses are lumped (section 2.2): add half the mass of each link to each of its nodes. A node may have zero mass if
  links to nodes with mass hold it. A free node without links needs a mass before `LatinStructureSetUp()`.

.seealso: `LatinStructureAttachTS()`, `TSLATIN`, `LatinStructureGetMass()`
@*/
PetscErrorCode LatinStructureSetMass(LatinStructure structure, const PetscReal mass[])
{
  PetscReal sum = 0.0;

  PetscFunctionBegin;
  PetscValidHeaderSpecific(structure, LATIN_STRUCTURE_CLASSID, 1);
  PetscCall(LatinCheckNumbers_Private(PetscObjectComm((PetscObject)structure), "Node", structure->nodes_start, structure->nodes_local, 1, mass, PETSC_FALSE, "a mass"));
  for (PetscInt i = 0; i < structure->nodes_local; i++) sum += mass[i];
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &sum, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  PetscCheck(sum > 0.0, PetscObjectComm((PetscObject)structure), PETSC_ERR_ARG_OUTOFRANGE, "No node has a mass: nothing resists acceleration");
  if (structure->set_up) PetscCall(LatinStructureCheckUnlinked_Private(structure, mass));
  if (!structure->mass) PetscCall(PetscMalloc1(structure->nodes_local + 1, &structure->mass)); /* + 1: not NULL on a rank without nodes */
  PetscCall(PetscArraycpy(structure->mass, mass, structure->nodes_local));
  PetscCall(VecDestroy(&structure->inertia));
  PetscCall(PetscObjectStateIncrease((PetscObject)structure));
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureGetMass - Gets the masses of the nodes of this rank.

  Not collective; the array is borrowed, read-only

  Input Parameter:
. structure - the structure

  Output Parameters:
+ n    - number of nodes of this rank; 0 if no masses are set
- mass - [n] masses; NULL if none are set

  Level: beginner

  Note:
  Pass NULL for what is not needed.

.seealso: `LatinStructureSetMass()`
@*/
PetscErrorCode LatinStructureGetMass(LatinStructure structure, PetscInt *n, const PetscReal *mass[])
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(structure, LATIN_STRUCTURE_CLASSID, 1);
  if (n) *n = structure->mass ? structure->nodes_local : 0;
  if (mass) *mass = structure->mass;
  PetscFunctionReturn(0);
}

/* Creates structure->inertia, M at the free degrees of freedom, unless it exists. Collective on structure */
PetscErrorCode LatinStructureInertia_Private(LatinStructure structure)
{
  const PetscInt dim = structure->dim;
  PetscReal     *m;

  PetscFunctionBegin;
  PetscCall(LatinStructureCheckSetUp_Private(structure));
  PetscCheck(structure->mass, PetscObjectComm((PetscObject)structure), PETSC_ERR_ORDER, "The structure has no masses: give its nodes a mass each (in Python, latinpc.Structure(..., mass=...); in C, LatinStructureSetMass())");
  if (structure->inertia) PetscFunctionReturn(0);
  PetscCall(PetscMalloc1(dim * structure->nodes_local, &m));
  for (PetscInt i = 0; i < dim * structure->nodes_local; i++) m[i] = structure->mass[i / dim];
  PetscCall(DMCreateGlobalVector(structure->dm, &structure->inertia));
  PetscCall(LatinStructureNodalVec_Private(structure, m, structure->inertia));
  PetscCall(PetscFree(m));
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureComputeKineticEnergy - Computes the kinetic energy 1/2 v^t M v of the nodes.

  Collective on structure

  Input Parameters:
+ structure - set up, with masses
- v         - velocities, a DM global vector

  Output Parameter:
. energy - over all ranks

  Level: intermediate

.seealso: `LatinStructureComputeEnergy()`, `LatinStructureSetMass()`
@*/
PetscErrorCode LatinStructureComputeKineticEnergy(LatinStructure structure, Vec v, PetscReal *energy)
{
  PetscFunctionBegin;
  PetscCall(LatinStructureCheckVec_Private(structure, v));
  PetscAssertPointer(energy, 3);
  PetscCall(LatinStructureInertia_Private(structure));
  PetscCall(LatinDiagonalProduct_Private(structure->inertia, v, v, energy));
  *energy *= 0.5;
  PetscFunctionReturn(0);
}

/* ---- a time step as a structure ---- */

/*
   Updates the step after changes of laws or masses of the base, and sets the springs G = shift M; shift < 0: leaves them, as the length of the step is
   not known yet. Increases the state of the step if G changes. Collective on step
*/
PetscErrorCode LatinStepLength_Private(LatinStructure step, PetscReal shift)
{
  PetscObjectState state;

  PetscFunctionBegin;
  PetscCall(LatinStructureInertia_Private(step->base));
  PetscCall(PetscObjectStateGet((PetscObject)step->base, &state));
  if (state != step->base_state) {
    LatinStructureCopyMembers(step, step->base);
    step->base_state = state;
    step->shift      = 0.0;
    step->midpoint   = (PetscBool)(step->geometry == LATIN_GEOMETRY_LARGE);
    PetscCall(PetscFree(step->span));
    if (step->base->span) {                                                    /* as drawn, until a step starts */
      PetscCall(PetscMalloc1(step->dim * step->links_local + 1, &step->span)); /* + 1: not NULL on a rank without links */
      PetscCall(PetscArraycpy(step->span, step->base->span, step->dim * step->links_local));
      PetscCall(PetscArraycpy(step->e0, step->base->e0, step->links_local));
    }
  }
  if (PetscAbsReal(shift - step->shift) <= LATIN_STEP_SAME * shift || shift < 0.0) PetscFunctionReturn(0);
  PetscCall(VecAXPBY(step->ground, shift, 0.0, step->base->inertia));
  step->shift = shift;
  PetscCall(PetscObjectStateIncrease((PetscObject)step));
  PetscFunctionReturn(0);
}

/* Checks that the geometry allows motions: linear, or large with elastic links alone. Collective on base */
PetscErrorCode LatinStepCheck_Private(LatinStructure base)
{
  PetscFunctionBegin;
  PetscCheck(base->geometry != LATIN_GEOMETRY_PRESTRESS, PetscObjectComm((PetscObject)base), PETSC_ERR_SUP, "Motions need the geometry linear or large, and the geometry of the structure is prestress: take -snes_latin_geometry large, or linear");
  PetscCheck(base->geometry == LATIN_GEOMETRY_LINEAR || base->rigid_law < 0, PetscObjectComm((PetscObject)base), PETSC_ERR_SUP, "Motions with large displacements are for elastic links, and the structure has links of the law %s: take %s",
             LatinLaws[PetscMax(0, base->rigid_law)].name, LatinLaws[PetscMax(0, base->rigid_law)].cure);
  PetscFunctionReturn(0);
}

/*
   Ends a step: stores the positions of supports, from which the next one starts. *moved (or NULL): set to true if supports of this rank have moved.
   Not collective
*/
PetscErrorCode LatinStepMade_Private(LatinStructure step, PetscBool *moved)
{
  const LatinStructure base = step->base;

  PetscFunctionBegin;
  for (PetscInt i = 0; moved && i < base->dim * base->nodes_local; i++) *moved = (PetscBool)(*moved || step->held[i] != base->prescribed[i]);
  PetscCall(PetscArraycpy(step->held, base->prescribed, base->dim * base->nodes_local));
  PetscCall(PetscArraycpy(step->vertex_held, base->vertex_prescribed, base->dim * base->vertices));
  PetscFunctionReturn(0);
}

/* Moves the supports back to their positions before the last step. Not collective */
PetscErrorCode LatinStepBack_Private(LatinStructure step)
{
  const LatinStructure base = step->base;
  const PetscReal      part = step->midpoint ? 0.5 : 1.0;

  PetscFunctionBegin;
  for (PetscInt i = 0; i < base->dim * base->nodes_local; i++) step->held[i] -= step->prescribed[i] / part;
  for (PetscInt i = 0; i < base->dim * base->vertices; i++) step->vertex_held[i] -= step->vertex_prescribed[i] / part;
  PetscFunctionReturn(0);
}

/* Copies positions and increments of supports from nodes to vertices, after a restart has set them. Collective on step */
PetscErrorCode LatinStepPlaced_Private(LatinStructure step)
{
  PetscFunctionBegin;
  PetscCall(LatinSFBcast_Private(step->vertex_sf, step->dim, MPIU_REAL, step->held, step->vertex_held));
  PetscCall(LatinSFBcast_Private(step->vertex_sf, step->dim, MPIU_REAL, step->prescribed, step->vertex_prescribed));
  step->held_state++;
  PetscFunctionReturn(0);
}

/* Sets the increments of prescribed displacements in the step, half of them for the midpoint rule */
static void LatinStepSupports(LatinStructure step)
{
  const LatinStructure base = step->base;
  const PetscReal      part = step->midpoint ? 0.5 : 1.0;

  for (PetscInt i = 0; i < base->dim * base->nodes_local; i++) step->prescribed[i] = part * (base->prescribed[i] - step->held[i]);
  for (PetscInt i = 0; i < base->dim * base->vertices; i++) step->vertex_prescribed[i] = part * (base->vertex_prescribed[i] - step->vertex_held[i]);
  step->held_state++;
}

/* Creates the time step of `base`, with supports where they are now. Collective on base */
PetscErrorCode LatinStepCreate_Private(LatinStructure base, LatinStructure *newstep)
{
  LatinStructure step;

  PetscFunctionBegin;
  PetscCall(LatinStructureDerive_Private(base, "Time step of a structure", &step));
  step->base       = base;
  step->base_state = -1; /* not updated yet */
  PetscCall(VecDuplicate(base->load, &step->load));
  PetscCall(VecDuplicate(base->load, &step->ground));
  PetscCall(
    PetscCalloc5(base->links_local, &step->e0, base->dim * base->nodes_local, &step->prescribed, base->dim * base->vertices, &step->vertex_prescribed, base->dim * base->nodes_local, &step->held, base->dim * base->vertices, &step->vertex_held));
  PetscCall(LatinStepMade_Private(step, NULL));
  PetscCall(LatinStepLength_Private(step, -1.0));
  *newstep = step;
  PetscFunctionReturn(0);
}

/* Returns the initial elongation of a link in a step, x: strain e- + e0 at its start; gaps up to `closed` count as zero */
static PetscReal LatinStepElongation(PetscInt law, PetscReal x, PetscReal closed)
{
  if (!LatinLaws[law].rigid) return x;      /* (9), (11) */
  if (law == LATIN_LAW_TANGENT) return 0.0; /* friction opposes the velocity */
  return (law == LATIN_LAW_INEXTENSIBLE ? -x : x) > closed ? x : 0.0;
}

/*
   Increases *flight to the largest displacement in the step, of supports, and of nodes if elastic links keep their tensions, at the strains step->e0, and
   rigid links have none. Collective on step
*/
static PetscErrorCode LatinStepFlight_Private(LatinStructure step, PetscReal *flight)
{
  Vec                w, none, local;
  PetscReal         *tension;
  const PetscScalar *a;

  PetscFunctionBegin;
  PetscCall(DMGetGlobalVector(step->dm, &w));
  PetscCall(DMGetGlobalVector(step->dm, &none));
  PetscCall(DMGetLocalVector(step->dm, &local));
  PetscCall(DMGetWorkArray(step->dm, step->base->links_local, MPIU_REAL, &tension));
  for (PetscInt l = 0; l < step->base->links_local; l++) tension[l] = LatinLaws[step->base->law[l]].rigid ? 0.0 : LatinStructureTension(step->base, NULL, l, step->e0[l]);
  PetscCall(VecZeroEntries(none));
  PetscCall(LatinStructureForces_Private(step, tension, none, step->load, w));
  PetscCall(VecPointwiseDivide(w, w, step->ground));
  PetscCall(LatinStructureGetLocal_Private(step, step->vertex_prescribed, w, local));
  PetscCall(VecGetArrayRead(local, &a));
  for (PetscInt i = 0; i < step->dim * (step->vertices - step->unlinked); i++) *flight = PetscMax(*flight, PetscAbsScalar(a[i]));
  PetscCall(VecRestoreArrayRead(local, &a));
  PetscCall(DMRestoreWorkArray(step->dm, step->base->links_local, MPIU_REAL, &tension));
  PetscCall(DMRestoreLocalVector(step->dm, &local));
  PetscCall(DMRestoreGlobalVector(step->dm, &none));
  PetscCall(DMRestoreGlobalVector(step->dm, &w));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, flight, 1, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)step)));
  PetscFunctionReturn(0);
}

/* Sets supports, initial elongations and, if links rotate, spans of a step that starts from u. Collective on step */
static PetscErrorCode LatinStepLinks_Private(LatinStructure step, Vec u)
{
  LatinStructure base   = step->base;
  PetscReal      flight = 0.0;

  PetscFunctionBegin;
  step->midpoint = (PetscBool)(base->geometry == LATIN_GEOMETRY_LARGE);
  LatinStepSupports(step);
  if (step->midpoint) {
    PetscCall(LatinTurningMove_Private(base, step->vertex_held, u, step->span, step->e0));
    PetscFunctionReturn(0);
  }
  PetscCall(LatinStructureElongations_Private(base, step->vertex_held, u, step->e0));
  for (PetscInt l = 0; l < base->links_local; l++) step->e0[l] += base->e0[l];
  if (base->rigid_law < 0) PetscFunctionReturn(0);
  PetscCall(LatinStepFlight_Private(step, &flight));
  for (PetscInt l = 0; l < base->links_local; l++) step->e0[l] = LatinStepElongation(base->law[l], step->e0[l], LATIN_STEP_CLOSED * flight);
  PetscFunctionReturn(0);
}

/* Starts a step of length h from (u, v), with the unknown h v+; midpoint rule: h is half the length, the unknown h (v + v+) / 2. Collective on step */
PetscErrorCode LatinStepStart_Private(LatinStructure step, PetscReal h, Vec u, Vec v)
{
  LatinStructure base = step->base;

  PetscFunctionBegin;
  PetscCall(LatinStepCheck_Private(base));
  PetscCheck(h > 0.0 && h * h > 0.0 && 1.0 / (h * h) > 0.0 && !PetscIsInfOrNanReal(1.0 / (h * h)), PetscObjectComm((PetscObject)step), PETSC_ERR_ARG_OUTOFRANGE,
             "A time step has the length %g; it must be positive and finite, with a finite 1 / h^2: set another one with -ts_dt or TSSetTimeStep()", (double)h);
  PetscCall(LatinStepLength_Private(step, 1.0 / (h * h)));
  PetscCall(VecPointwiseMult(step->load, base->inertia, v));
  PetscCall(VecAYPX(step->load, 1.0 / h, base->load));
  step->load_state++;
  PetscCall(LatinStepLinks_Private(step, u));
  step->e0_state++;
  PetscFunctionReturn(0);
}

/* Turns the step into the base on springs shift M, with displacements as the unknown: for Jacobians of other integrators. Collective on step */
PetscErrorCode LatinStepShift_Private(LatinStructure step, PetscReal shift)
{
  LatinStructure base = step->base;

  PetscFunctionBegin;
  PetscCall(LatinStepLength_Private(step, shift));
  PetscCall(VecCopy(base->load, step->load));
  step->load_state++;
  step->midpoint = PETSC_FALSE;
  if (base->span) PetscCall(PetscArraycpy(step->span, base->span, base->dim * base->links_local));
  PetscCall(PetscArraycpy(step->e0, base->e0, base->links_local));
  step->e0_state++;
  PetscCall(PetscArraycpy(step->prescribed, base->prescribed, base->dim * base->nodes_local));
  PetscCall(PetscArraycpy(step->vertex_prescribed, base->vertex_prescribed, base->dim * base->vertices));
  PetscFunctionReturn(0);
}
