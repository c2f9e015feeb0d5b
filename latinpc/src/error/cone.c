#include "error/latinerror.h"

/*
   Projection of a load f on the cone of forces that a few links can bear, by the active-set method for nonnegative least squares
   [C. L. Lawson, R. J. Hanson]. The residual r = f - sum over i of t_i a_i, with t_i of any sign for the first links and t_i >= 0 for the
   others, has minimal norm. r = 0 if and only if the links bear f. Else r is a mechanism: f does the work |r|^2 on it, the first
   links keep their length and no other one becomes longer.

   The rows a of the links in the basis, those that may bear, are orthonormalised to q by the Gram-Schmidt method, twice against
   rounding. So r is orthogonal to them to rounding, whatever their condition.
*/

#define LATIN_CONE_SPAN     PETSC_SQRT_MACHINE_EPSILON    /* a row depends on the basis if less than this part of it is orthogonal to that */
#define LATIN_CONE_RESIDUAL LatinByPrecision(1e-9, 1e-4)  /* residual, relative to the load, that counts as zero */
#define LATIN_CONE_SIGN     (1e3 * PETSC_MACHINE_EPSILON) /* rounding of the residual along a row, relative to the load */
#define LATIN_CONE_CHANGES  4                             /* most changes of the basis per link; without rounding the method is finite */

static PetscReal LatinConeDot(PetscInt n, const PetscReal a[], const PetscReal b[])
{
  PetscReal sum = 0.0;

  for (PetscInt i = 0; i < n; i++) sum += a[i] * b[i];
  return sum;
}

/* Orthogonalises b against the basis. part: NULL, or [basis], to which the coefficients are added */
static void LatinConeOrthogonal(const LatinCone *c, PetscReal b[], PetscReal part[])
{
  for (PetscInt k = 0; k < c->basis; k++) {
    const PetscReal *q = c->q + c->n * k, by = LatinConeDot(c->n, q, b);

    for (PetscInt i = 0; i < c->n; i++) b[i] -= by * q[i];
    if (part) part[k] += by;
  }
}

/* Adds link l to the basis. Returns false if its row depends on those of the basis */
static PetscBool LatinConeAdd(LatinCone *c, PetscInt l)
{
  const PetscInt n = c->n, k = c->basis;
  PetscReal     *q = c->q + n * k, *part = c->part + n * k, size;

  if (k >= n) return PETSC_FALSE;
  for (PetscInt i = 0; i < n; i++) {
    q[i]    = c->row[n * l + i];
    part[i] = 0.0;
  }
  for (PetscInt twice = 0; twice < 2; twice++) LatinConeOrthogonal(c, q, part);
  size = PetscSqrtReal(LatinConeDot(n, q, q));
  if (!(size > LATIN_CONE_SPAN)) return PETSC_FALSE;
  for (PetscInt i = 0; i < n; i++) q[i] /= size;
  part[k]     = size;
  c->along[k] = LatinConeDot(n, q, c->r);
  for (PetscInt i = 0; i < n; i++) c->r[i] -= c->along[k] * q[i];
  c->link[k]  = l;
  c->state[l] = LATIN_CONE_BASIS;
  c->basis++;
  return PETSC_TRUE;
}

/* Computes the least-squares tensions t of the basis, [basis], by back substitution */
static void LatinConeTensions(const LatinCone *c, PetscReal t[])
{
  for (PetscInt k = c->basis - 1; k >= 0; k--) {
    t[k] = c->along[k];
    for (PetscInt j = k + 1; j < c->basis; j++) t[k] -= c->part[c->n * j + k] * t[j];
    t[k] /= c->part[c->n * k + k];
  }
}

/* Drops unilateral links without tension from the basis, and orthogonalises those behind the first of them again */
static void LatinConeDrop(LatinCone *c, PetscInt both, const PetscReal f[])
{
  const PetscInt before = c->basis;
  PetscInt       first  = 0;

  while (first < before && (c->link[first] < both || c->t[first] > 0.0)) first++;
  c->basis = first;
  for (PetscInt i = 0; i < c->n; i++) c->r[i] = f[i];
  LatinConeOrthogonal(c, c->r, NULL);
  for (PetscInt k = first; k < before; k++) {
    const PetscInt  l = c->link[k];
    const PetscReal t = c->t[k];

    c->state[l] = LATIN_CONE_SLACK;
    if (l >= both && !(t > 0.0)) continue;
    c->t[c->basis] = t;
    LatinConeAdd(c, l);
  }
}

/* Moves the tensions of the basis towards the least-squares ones. Returns false if the tension of a unilateral link becomes zero on the way */
static PetscBool LatinConeMove(LatinCone *c, PetscInt both)
{
  PetscReal length = 1.0;
  PetscInt  stop   = -1;

  LatinConeTensions(c, c->next);
  for (PetscInt k = 0; k < c->basis; k++) {
    if (c->link[k] < both || c->next[k] > 0.0 || c->t[k] == c->next[k]) continue;
    if (c->t[k] <= length * (c->t[k] - c->next[k])) {
      length = c->t[k] / (c->t[k] - c->next[k]);
      stop   = k;
    }
  }
  for (PetscInt k = 0; k < c->basis; k++) c->t[k] += length * (c->next[k] - c->t[k]);
  if (stop >= 0) c->t[stop] = 0.0;
  return (PetscBool)(stop < 0);
}

/* Returns the unilateral link with the greatest elongation along r, above `least`; -1: none */
static PetscInt LatinConeLonger(const LatinCone *c, PetscInt links, PetscInt both, PetscReal least)
{
  PetscInt best = -1;

  for (PetscInt l = both; l < links; l++) {
    PetscReal along;

    if (c->state[l] != LATIN_CONE_SLACK) continue;
    along = LatinConeDot(c->n, c->row + c->n * l, c->r);
    if (along <= least) continue;
    least = along;
    best  = l;
  }
  return best;
}

/*
   Computes the residual c->r of the load f, borne by `links` links with rows c->row, the first `both` of them bilateral. *bears: r = 0 to rounding,
   or no convergence
*/
void LatinConeProject(LatinCone *c, PetscInt n, PetscInt links, PetscInt both, const PetscReal f[], PetscBool *bears)
{
  const PetscReal size = PetscSqrtReal(LatinConeDot(n, f, f));

  c->n     = n;
  c->basis = 0;
  *bears   = PETSC_TRUE;
  for (PetscInt i = 0; i < n; i++) c->r[i] = f[i];
  for (PetscInt l = 0; l < links; l++) c->state[l] = LATIN_CONE_SLACK;
  for (PetscInt l = 0; l < both; l++) LatinConeAdd(c, l);
  LatinConeTensions(c, c->t);
  for (PetscInt turn = 0; turn < LATIN_CONE_CHANGES * links; turn++) {
    PetscInt l;

    if (PetscSqrtReal(LatinConeDot(n, c->r, c->r)) <= LATIN_CONE_RESIDUAL * size) return;
    l = LatinConeLonger(c, links, both, LATIN_CONE_SIGN * size);
    if (l < 0) {
      LatinConeOrthogonal(c, c->r, NULL);
      *bears = PETSC_FALSE;
      return;
    }
    if (LatinConeAdd(c, l)) c->t[c->basis - 1] = 0.0;
    else c->state[l] = LATIN_CONE_SPANNED;
    while (!LatinConeMove(c, both)) LatinConeDrop(c, both, f);
  }
}

/*
   Returns whether the residual c->r of LatinConeProject() proves that there is no equilibrium, by LatinCollapseProves(). Normalises it. largest: largest
   load of the structure; A: work, [n][n], for the stiffness if all links are bars
*/
PetscBool LatinConeProves(LatinCone *c, PetscInt links, PetscInt both, const PetscReal f[], PetscReal largest, PetscReal A[])
{
  const PetscInt n    = c->n;
  PetscReal      size = 0.0, tension = 0.0, push = 0.0, resisted = 0.0, all = 0.0;

  for (PetscInt i = 0; i < n * n; i++) A[i] = 0.0;
  for (PetscInt l = 0; l < links; l++)
    for (PetscInt j = 0; j < n; j++) {
      const PetscReal *row = c->row + n * l;

      for (PetscInt i = j; row[j] != 0.0 && i < n; i++) A[i + n * j] += row[i] * row[j];
    }
  if (!LatinCholesky(n, A)) return PETSC_FALSE;
  for (PetscInt i = 0; i < n; i++) { /* f = L y, and f.A^-1 f = y.y */
    PetscReal *y = c->along;

    y[i] = f[i];
    for (PetscInt j = 0; j < i; j++) y[i] -= A[i + n * j] * y[j];
    y[i] /= A[i + n * i];
    tension += PetscSqr(y[i]);
    size += PetscSqr(c->r[i]);
  }
  for (PetscInt i = 0; i < n; i++) {
    c->r[i] /= PetscSqrtReal(size);
    push += f[i] * c->r[i];
  }
  for (PetscInt l = 0; l < links; l++) {
    const PetscReal x = LatinConeDot(n, c->row + n * l, c->r);

    all += x * x;
    if (l < both || x > 0.0) resisted += x * x;
  }
  return (PetscBool)(tension > 0.0 && LatinCollapseProves(push / PetscSqrtReal(tension), largest / PetscSqrtReal(tension), resisted, all));
}
