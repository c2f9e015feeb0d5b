#include "structure/structureimpl.h"

/* The energy of a structure along a step of Newton's method, from u to u - t step. */

#define LATIN_SEARCH_MOST      80   /* trial lengths: every third halves the interval */
#define LATIN_SEARCH_GROWS     8.0  /* the next length where the energy falls all the way */
#define LATIN_SEARCH_FAR       1e12 /* the longest */
#define LATIN_SEARCH_TOLERANCE 1e-3 /* slope at the end, relative to the first one; hardly any step depends on it */

/* The links along a step: strains x - t d, and t bend of the springs to the ground */
typedef struct {
  PetscReal *x, *d, *tension; /* [links_local] */
  PetscReal  work, bend;      /* slope at t = 0 of loads and springs, and how the springs change it */
} LatinLine;

/* The derivative of the energy with t. Collective on structure */
static PetscErrorCode LatinLineSlope_Private(LatinStructure structure, const LatinLine *line, PetscReal t, PetscReal *slope)
{
  PetscFunctionBegin;
  *slope = 0.0;
  for (PetscInt l = 0; l < structure->links_local; l++) line->tension[l] = LatinStructureTension(structure, NULL, l, line->x[l] - t * line->d[l]);
  if (structure->penalty && structure->rubs) LatinFrictionCap(structure, line->tension);
  for (PetscInt l = 0; l < structure->links_local; l++) *slope -= line->tension[l] * line->d[l];
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, slope, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  *slope += line->work + t * line->bend;
  PetscFunctionReturn(0);
}

/*
   The length t at which the energy along u - t step is least, and 1 when it falls all the way; `more` is a load beside that
   of the structure, or NULL. Where slack links keep some stiffness, a step may be too short by orders of magnitude: the
   bracket grows from 1 until the energy rises at its end. The derivative of the energy is monotone and piecewise linear in t, so that a
   secant that never leaves its bracket ends soon. Collective on structure.
*/
PetscErrorCode LatinStructureSearch_Private(LatinStructure structure, Vec u, Vec step, Vec more, PetscReal *length)
{
  const PetscInt n   = structure->links_local;
  PetscReal      low = 0.0, high = 1.0, slope[2] = {0.0, 0.0}, first, t = 1.0, here, held;
  PetscScalar    work, other = 0.0;
  LatinLine      line;

  PetscFunctionBegin;
  PetscCall(PetscMalloc3(n, &line.x, n, &line.d, n, &line.tension));
  PetscCall(LatinStructureStrains_Private(structure, u, line.x));
  PetscCall(LatinStructureElongations_Private(structure, NULL, step, line.d)); /* no change where prescribed */
  PetscCall(VecDot(structure->load, step, &work));
  if (more) PetscCall(VecDot(more, step, &other));
  /* a quadratic energy: g (u - t step)^2 / 2 */
  PetscCall(LatinDiagonalProduct_Private(structure->ground, u, step, &held));
  PetscCall(LatinDiagonalProduct_Private(structure->ground, step, step, &line.bend));
  line.work = PetscRealPart(work + other) - held;
  PetscCall(LatinLineSlope_Private(structure, &line, 0.0, &first));
  slope[0] = first;
  for (PetscInt k = 0; k < LATIN_SEARCH_MOST; k++) {
    PetscCall(LatinLineSlope_Private(structure, &line, t, &here));
    if (k == 0 && first >= 0.0) break; /* it was never falling: rounding */
    if (PetscAbsReal(here) <= LATIN_SEARCH_TOLERANCE * PetscAbsReal(first)) break;
    if (here > 0.0) {
      high     = t;
      slope[1] = here;
    } else {
      low      = t;
      slope[0] = here;
    }
    if (slope[1] == 0.0) { /* it falls all the way so far */
      t = LATIN_SEARCH_GROWS * low;
      if (t < LATIN_SEARCH_FAR) continue;
      t = 1.0;
      break;
    }
    /* the secant, or the middle every third time, when one end does not move */
    t = k % 3 == 2 ? 0.5 * (low + high) : low - slope[0] * (high - low) / (slope[1] - slope[0]);
    if (high - low <= PETSC_MACHINE_EPSILON * high) break;
  }
  PetscCall(PetscFree3(line.x, line.d, line.tension));
  *length = t;
  PetscFunctionReturn(0);
}

/* Twice the energy per square of the length t that u - t step stores for t without end: that of links far out. Collective on structure */
PetscErrorCode LatinStructureResistFar_Private(LatinStructure structure, Vec step, PetscReal *resisted)
{
  PetscReal *d, ground;

  PetscFunctionBegin;
  *resisted = 0.0;
  PetscCall(DMGetWorkArray(structure->dm, structure->links_local, MPIU_REAL, &d));
  PetscCall(LatinStructureElongations_Private(structure, NULL, step, d));
  for (PetscInt l = 0; l < structure->links_local; l++) *resisted += LatinStructureTangent(structure, l, d[l] < 0.0 ? LATIN_FAR : -LATIN_FAR) * d[l] * d[l];
  PetscCall(DMRestoreWorkArray(structure->dm, structure->links_local, MPIU_REAL, &d));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, resisted, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  PetscCall(LatinDiagonalProduct_Private(structure->ground, step, step, &ground));
  *resisted += ground;
  PetscFunctionReturn(0);
}
