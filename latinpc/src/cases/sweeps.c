#include "base/vector.h"
#include "cases/latincases.h"

/*
   The two sweeps of a stage over the links. Ends, direction and stiffness are read once for all lanes, which are those of
   vector instructions. Functions of this file are called with constants for dim, so that their loops unroll.
*/

#define LATIN_FOR_CASES(w) _Pragma("omp simd") for (PetscInt w = 0; w < LATIN_CASE_LANES; w++)

/* Adds to e the elongations of link l under the displacements a */
LATIN_INLINE void LatinCaseElongation(const LatinCaseLinks *links, const PetscInt dim, PetscInt l, const PetscReal a[], PetscReal e[])
{
  const PetscReal *n = links->direction + dim * l, *from = a + dim * LATIN_CASE_LANES * links->ends[2 * l], *to = a + dim * LATIN_CASE_LANES * links->ends[2 * l + 1];

  for (PetscInt c = 0; c < dim; c++) LATIN_FOR_CASES(w) e[w] += n[c] * (to[LATIN_CASE_LANES * c + w] - from[LATIN_CASE_LANES * c + w]);
}

LATIN_INLINE void LatinCasesForces_Dim(LatinCaseLinks *links, const PetscInt dim)
{
  PetscReal all[LATIN_CASE_LANES] = {0.0};

  for (PetscInt l = 0; l < links->links; l++) {
    const PetscReal k = links->stiffness[l], sign = links->sign[l], least = sign * sign - 1.0, *n = links->direction + dim * l, *e0 = links->e0 + LATIN_CASE_LANES * l;
    PetscReal      *from = links->r + dim * LATIN_CASE_LANES * links->ends[2 * l], *to = links->r + dim * LATIN_CASE_LANES * links->ends[2 * l + 1];
    float          *tangent = links->tangent + LATIN_CASE_LANES * l;
    PetscReal       x[LATIN_CASE_LANES];

    LATIN_FOR_CASES(w) x[w] = e0[w];
    LatinCaseElongation(links, dim, l, links->u, x);
    LATIN_FOR_CASES(w)
    {
      const PetscReal taut = sign * x[w] > least ? k : 0.0;

      tangent[w] = (float)taut;
      x[w] *= taut;
      all[w] += x[w] * x[w];
    }
    for (PetscInt c = 0; c < dim; c++) {
      LATIN_FOR_CASES(w) from[LATIN_CASE_LANES * c + w] += n[c] * x[w];
      LATIN_FOR_CASES(w) to[LATIN_CASE_LANES * c + w] -= n[c] * x[w];
    }
  }
  LATIN_FOR_CASES(w) links->all[w] = all[w];
}

/* r -= B^t tau of the displacements u, their tangents and the squares of their tensions */
LATIN_CLONES void LatinCasesForces(LatinCaseLinks *links)
{
  if (links->dim == 3) LatinCasesForces_Dim(links, 3);
  else if (links->dim == 2) LatinCasesForces_Dim(links, 2);
  else LatinCasesForces_Dim(links, 1);
}

LATIN_INLINE void LatinCasesResistance_Dim(LatinCaseLinks *links, const PetscInt dim)
{
  PetscReal work[LATIN_CASE_LANES] = {0.0}, tension[LATIN_CASE_LANES] = {0.0}, bend[LATIN_CASE_LANES] = {0.0};

  for (PetscInt l = 0; l < links->links; l++) {
    const float *tangent             = links->tangent + LATIN_CASE_LANES * l;
    PetscReal    e[LATIN_CASE_LANES] = {0.0}, d[LATIN_CASE_LANES] = {0.0};

    LatinCaseElongation(links, dim, l, links->w, e);
    LatinCaseElongation(links, dim, l, links->p, d);
    LATIN_FOR_CASES(w)
    {
      const PetscReal k = (PetscReal)tangent[w], t = k * e[w];

      d[w] = e[w] + links->beta[w] * d[w];
      work[w] += t * e[w];
      tension[w] += t * t;
      bend[w] += k * d[w] * d[w];
    }
  }
  LATIN_FOR_CASES(w) links->work[w]    = work[w];
  LATIN_FOR_CASES(w) links->tension[w] = tension[w];
  LATIN_FOR_CASES(w) links->bend[w]    = bend[w];
}

/* What the tangents oppose to w and to w + beta p */
LATIN_CLONES void LatinCasesResistance(LatinCaseLinks *links)
{
  if (links->dim == 3) LatinCasesResistance_Dim(links, 3);
  else if (links->dim == 2) LatinCasesResistance_Dim(links, 2);
  else LatinCasesResistance_Dim(links, 1);
}
