#include "sneslatinimpl.h"
#include <petsc/private/snesimpl.h>

/*
   When Newton's method takes over from SNES latin (polish.c).

   A linear stage treats every link as a spring of its ascent direction l = k. A slack link that is much stiffer than the
   structure around it, or a structure that only soft slack links hold, leaves displacements that hardly move from one
   stage to the next: the iteration would need as many stages as the ratio of the stiffnesses. Newton's method leaves
   slack links out of its operator.
*/

#define LATIN_RESCUE_WINDOW   20                           /* linear stages over which progress is measured */
#define LATIN_RESCUE_CONTRAST 1e6                          /* ratio of stiffnesses from which on a displacement that does not move proves nothing */
#define LATIN_RESCUE_LEFT     0.1                          /* part of the loads that tensions do not balance along a mechanism */
#define LATIN_RESCUE_LOOSE    LatinByPrecision(1e-7, 1e-4) /* stiffness of a mechanism, relative to that of the softest link */

/* Before the first linear stage of a solve. Collective on links */
PetscErrorCode LatinRescueStart_Private(LatinRescue *rescue, LatinLinks links)
{
  PetscReal least, most;

  PetscFunctionBegin;
  rescue->seen   = 0;
  rescue->called = PETSC_FALSE;
  rescue->loose  = 0;
  for (PetscInt i = 0; i < 3; i++) rescue->least[i] = PETSC_MAX_REAL;
  PetscCall(LatinLinksStiffnessRange_Private(links, &least, &most));
  rescue->able     = (PetscBool)(rescue->stages && links->rigid_law < 0 && !links->rubs); /* Newton's method wants a tangent, and an energy */
  rescue->contrast = (PetscBool)(most > LATIN_RESCUE_CONTRAST * least);
  PetscFunctionReturn(0);
}

/*
   Would the iteration need too many more linear stages, at the rate of the last two windows? To be called once a stage
   with what the stop is on.
*/
PetscBool LatinRescueStalled(LatinRescue *rescue, PetscReal measure, PetscReal target)
{
  const PetscReal before = rescue->least[2];
  PetscReal       now;

  rescue->least[0] = PetscMin(rescue->least[0], measure);
  if (++rescue->seen % LATIN_RESCUE_WINDOW) return PETSC_FALSE;
  now              = PetscMin(rescue->least[0], rescue->least[1]);
  rescue->least[2] = rescue->least[1];
  rescue->least[1] = rescue->least[0];
  rescue->least[0] = PETSC_MAX_REAL;
  if (!rescue->able || rescue->called || !(before < PETSC_MAX_REAL) || !(target > 0.0)) return PETSC_FALSE;
  return (PetscBool)(2 * LATIN_RESCUE_WINDOW * PetscLogReal(now / target) > (PetscReal)rescue->stages * PetscLogReal(before / now));
}

/*
   The nodes that the last step of Newton's method moves though no link resists, however far they go, and that the loads
   push on: then the energy has no least value. Links that will resist once a gap has closed are no mechanism.
   Collective on the structure.
*/
PetscErrorCode LatinRescueLoose_Private(LatinRescue *rescue)
{
  LatinLinks     links = rescue->newton.links;
  MPI_Comm       comm  = PetscObjectComm((PetscObject)links);
  const PetscInt dim   = links->dim;
  PetscInt       mine[LATIN_LOOSE], found = 0, count = 0;
  PetscReal     *move, most, length, least;
  PetscReal      resisted;
  PetscScalar    pushed, left;
  Vec            step, work, r;

  PetscFunctionBegin;
  rescue->loose = 0;
  PetscCall(SNESGetSolutionUpdate(rescue->newton.newton, &step));
  if (!step) PetscFunctionReturn(0);
  PetscCall(VecNorm(step, NORM_INFINITY, &most));
  PetscCall(VecNorm(step, NORM_2, &length));
  if (!(most > 0.0) || PetscIsInfOrNanReal(length)) PetscFunctionReturn(0);
  PetscCall(LatinLinksStiffnessRange_Private(links, &least, NULL));
  PetscCall(LatinLinksResistFar_Private(links, step, &resisted));
  PetscCall(VecDuplicate(step, &work));
  PetscCall(VecCopy(links->load, work));
  if (rescue->newton.newton->vec_rhs) PetscCall(VecAXPY(work, 1.0, rescue->newton.newton->vec_rhs));
  PetscCall(SNESGetFunction(rescue->newton.newton, &r, NULL, NULL));
  PetscCall(VecDot(work, step, &pushed));
  PetscCall(VecDot(r, step, &left));
  PetscCall(VecDestroy(&work));
  if (resisted > LATIN_RESCUE_LOOSE * least * length * length || PetscAbsScalar(left) <= LATIN_RESCUE_LEFT * PetscAbsScalar(pushed)) PetscFunctionReturn(0);
  PetscCall(PetscMalloc1(dim * links->nodes_local, &move));
  PetscCall(LatinLinksGetDisplacements(links, step, move));
  for (PetscInt i = 0; i < links->nodes_local; i++) {
    PetscReal size = 0.0;

    for (PetscInt c = 0; c < dim; c++) size = PetscMax(size, links->fixed[dim * i + c] ? 0.0 : PetscAbsReal(move[dim * i + c]));
    if (size < 0.5 * most) continue;
    if (found < LATIN_LOOSE) mine[found++] = links->nodes_start + i;
    count++;
  }
  PetscCall(PetscFree(move));
  for (PetscInt i = found; i < LATIN_LOOSE; i++) mine[i] = PETSC_MAX_INT;
  PetscCall(LatinListFirst_Private(comm, LATIN_LOOSE, mine, rescue->node));
  PetscCall(MPIU_Allreduce(&count, &rescue->loose, 1, MPIU_INT, MPI_SUM, comm));
  PetscFunctionReturn(0);
}
