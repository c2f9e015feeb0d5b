#include "structure/structureimpl.h"

/* Line search: minimises the energy of a structure along a Newton step, at u - t step. */

#define LATIN_SEARCH_MOST      80                            /* most trial lengths; every third halves the bracket */
#define LATIN_SEARCH_GROWS     8.0                           /* factor on the length while the energy decreases */
#define LATIN_SEARCH_FAR       1e12                          /* largest length t; if the energy decreases beyond, it has no minimum */
#define LATIN_SEARCH_TOLERANCE LatinByPrecision(1e-10, 1e-4) /* largest slope at the end, relative to the first; with 1e-3 steps stall where links yield */

/* The energy along a step, with strains x - t d. Loads and springs to the ground add work + t bend to its slope */
typedef struct {
  PetscReal *x, *d, *tension; /* [links_local]; the last one is work space */
  PetscReal  work, bend;
} LatinLine;

/* Computes the derivative of the energy with respect to t. Overwrites line->tension. Collective on structure */
static PetscErrorCode LatinLineSlope_Private(LatinStructure structure, const LatinLine *line, PetscReal t, PetscReal *slope)
{
  PetscFunctionBegin;
  *slope = 0.0;
  for (PetscInt l = 0; l < structure->links_local; l++) line->tension[l] = LatinStructureTension(structure, NULL, l, line->x[l] - t * line->d[l]);
  for (PetscInt l = 0; l < structure->links_local; l++) *slope -= line->tension[l] * line->d[l];
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, slope, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  *slope += line->work + t * line->bend;
  PetscFunctionReturn(0);
}

/*
   Computes *length, the minimiser t of the energy at u - t step; 1 if the energy decreases without bound. more: an additional load, or NULL. If slack
   links have a small stiffness, steps are too short by orders of magnitude: the bracket grows from 1 until the slope at its end is positive. The slope
   is monotone and piecewise linear in t, so the bracketed secant method converges in a few trials. Collective on structure
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
  PetscCall(LatinStructureElongations_Private(structure, NULL, step, line.d)); /* zero where prescribed */
  PetscCall(VecDot(structure->load, step, &work));
  if (more) PetscCall(VecDot(more, step, &other));
  /* springs g to the ground have the energy g (u - t step)^2 / 2 */
  PetscCall(LatinDiagonalProduct_Private(structure->ground, u, step, &held));
  PetscCall(LatinDiagonalProduct_Private(structure->ground, step, step, &line.bend));
  line.work = PetscRealPart(work + other) - held;
  PetscCall(LatinLineSlope_Private(structure, &line, 0.0, &first));
  slope[0] = first;
  for (PetscInt k = 0; k < LATIN_SEARCH_MOST; k++) {
    PetscCall(LatinLineSlope_Private(structure, &line, t, &here));
    if (k == 0 && first >= 0.0) break; /* not a descent direction, by rounding */
    if (PetscAbsReal(here) <= LATIN_SEARCH_TOLERANCE * PetscAbsReal(first)) break;
    if (here > 0.0) {
      high     = t;
      slope[1] = here;
    } else {
      low      = t;
      slope[0] = here;
    }
    if (slope[1] == 0.0) { /* no bracket yet: the energy still decreases */
      t = LATIN_SEARCH_GROWS * low;
      if (t < LATIN_SEARCH_FAR) continue;
      t = 1.0;
      break;
    }
    /* secant; every third time bisection, as one end may stay */
    t = k % 3 == 2 ? 0.5 * (low + high) : low - slope[0] * (high - low) / (slope[1] - slope[0]);
    if (high - low <= PETSC_MACHINE_EPSILON * high) break;
  }
  PetscCall(PetscFree3(line.x, line.d, line.tension));
  *length = t;
  PetscFunctionReturn(0);
}

/*
   Computes, for t to infinity, *resisted: curvature of the energy along u - t step, by the stiffness of links at large strains; *borne: slope by the
   tensions of links without stiffness there, as those that yield; loads are left out. Collective on structure
*/
PetscErrorCode LatinStructureResistFar_Private(LatinStructure structure, Vec step, PetscReal *resisted, PetscReal *borne)
{
  PetscReal *d, ground, sum[2] = {0.0, 0.0};

  PetscFunctionBegin;
  PetscCall(DMGetWorkArray(structure->dm, structure->links_local, MPIU_REAL, &d));
  PetscCall(LatinStructureElongations_Private(structure, NULL, step, d));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscReal far = d[l] < 0.0 ? LATIN_FAR : -LATIN_FAR, k = LatinStructureTangent(structure, l, far);

    sum[0] += k * d[l] * d[l];
    if (k == 0.0 && !LatinLaws[structure->law[l]].rigid) sum[1] -= LatinStructureTension(structure, NULL, l, far) * d[l];
  }
  PetscCall(DMRestoreWorkArray(structure->dm, structure->links_local, MPIU_REAL, &d));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  *resisted = sum[0];
  *borne    = sum[1];
  PetscCall(LatinDiagonalProduct_Private(structure->ground, step, step, &ground));
  *resisted += ground;
  PetscFunctionReturn(0);
}
