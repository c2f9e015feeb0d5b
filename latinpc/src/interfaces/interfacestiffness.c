#include "interfaces/latininterfaces.h"

/*
   The stiffness of the subdomains at one of their interfaces, the scale of a good search direction: the diagonal of B^t k B;
   its block on the side dofs of the interface; or its Schur complement there, the rest of the subdomain free.

   A subdomain may float or have mechanisms. Then its Schur complement is nearly singular for the displacements that
   need springs most. So a small part of the diagonal of B^t k B is added to it: the links rest on an elastic foundation.
   This bounds the eigenvalues of the matrices relative to that diagonal from below.
*/

#define LATIN_STIFFNESS_FLOOR 0.01 /* foundation, relative to the diagonal of B^t k B; half or twice as much costs 2 to 5 iterations */
#define LATIN_STIFFNESS_SIDES 0.05 /* the same of PC latin, on interfaces alone: CG takes a quarter fewer iterations than with LATIN_STIFFNESS_FLOOR */
/* least diagonal entry, relative to the mean of the subdomain, for dofs of almost no stiffness; it only has to be positive */
#define LATIN_STIFFNESS_LEAST 0.1
/*
   the same for matrices, which have no such dofs and whose coefficients may jump by 1e10; also the foundation of PC latin off the interfaces, and
   everywhere if no subdomain has an interior
*/
#define LATIN_STIFFNESS_TINY LatinByPrecision(1e-10, 1e-5)

/* Computes the foundation spring[copies * bs] of the subdomains. Collective on sub->object. */
static PetscErrorCode LatinStiffnessFoundation_Private(LatinDirections *dir, PetscReal spring[])
{
  const LatinSubdomains *sub    = dir->sub;
  const PetscInt         bs     = dir->sub->bs;
  PetscReal              sum[2] = {0.0, 0.0}, fallback;

  PetscFunctionBegin;
  PetscCall(LatinOperatorDiagonal(dir->sub, spring));
  for (PetscInt i = 0; i < bs * sub->copies; i++)
    if (!sub->fixed[i]) {
      sum[0] += spring[i];
      sum[1] += 1.0;
    }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm(dir->sub->object)));
  fallback = sum[0] > 0.0 ? sum[0] / sum[1] : 1.0;
  for (PetscInt s = 0; s < sub->n; s++) {
    const PetscInt first = bs * sub->node_offset[s], last = bs * sub->node_offset[s + 1];
    PetscReal      mean = 0.0;
    PetscInt       n    = 0;

    for (PetscInt i = first; i < last; i++)
      if (!sub->fixed[i]) {
        mean += spring[i];
        n++;
      }
    mean /= PetscMax(n, 1);
    if (!(mean > 0.0)) mean = fallback; /* the subdomain has no stiffness, as when all its links are slack */
    for (PetscInt i = first; i < last; i++) {
      const PetscReal floor = !sub->preconditions ? LATIN_STIFFNESS_FLOOR : sub->multiplicity[i / bs] > 1 && !LatinDirectionCondensed(dir) ? LATIN_STIFFNESS_SIDES : LATIN_STIFFNESS_TINY;

      spring[i] = floor * PetscMax(spring[i], (sub->matrix ? LATIN_STIFFNESS_TINY : LATIN_STIFFNESS_LEAST) * mean);
    }
  }
  PetscFunctionReturn(0);
}

/* Copies the block of K at the side dofs of one interface to S. at[rows of the subdomain]: work, -1 before and after */
static void LatinStiffnessBlock(const LatinDirections *dir, const LatinSparse *K, const LatinInterface *face, PetscInt at[], PetscReal S[])
{
  const PetscInt rows = face->side_last - face->side_first, top = dir->sub->bs * dir->sub->node_offset[face->sub], *dof = dir->inter->side_dof + face->side_first;

  for (PetscInt i = 0; i < rows * rows; i++) S[i] = 0.0;
  for (PetscInt r = 0; r < rows; r++) at[dof[r] - top] = r;
  for (PetscInt r = 0; r < rows; r++)
    for (PetscInt k = K->i[dof[r] - top]; k < K->i[dof[r] - top + 1]; k++)
      if (at[K->j[k]] >= 0) S[r + rows * at[K->j[k]]] = K->a[k];
  for (PetscInt r = 0; r < rows; r++) at[dof[r] - top] = -1;
}

/* The same for a subdomain without interior, from its operator, foundation included */
static void LatinStiffnessDense(const LatinDirections *dir, const PetscReal spring[], const LatinInterface *face, PetscInt at[], PetscReal S[])
{
  const PetscInt rows = face->side_last - face->side_first, top = dir->sub->node_offset[face->sub], *dof = dir->inter->side_dof + face->side_first;

  for (PetscInt r = 0; r < rows; r++) at[dof[r] - top] = r;
  LatinOperatorDense(dir->sub, face->sub, rows, at, S);
  for (PetscInt r = 0; r < rows; r++) S[r + rows * r] += spring[dof[r]];
  for (PetscInt r = 0; r < rows; r++) at[dof[r] - top] = -1;
}

/*
   Computes the Schur complements S + first[f] on each interface of subdomain s from F, the inverse (gamma x gamma) of that on all of them together;
   at[row]: position of a row in F. *bad: one is not positive definite
*/
static PetscErrorCode LatinStiffnessSchur_Private(LatinDirections *dir, PetscInt s, PetscInt gamma, const PetscReal F[], const PetscInt at[], const size_t first[], PetscReal S[], PetscBool *bad)
{
  const LatinInterfaces *inter = dir->inter;
  const PetscInt         top   = dir->sub->bs * dir->sub->node_offset[s];

  PetscFunctionBegin;
  for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++) {
    const LatinInterface *face = &inter->interface[f];
    const PetscInt        rows = face->side_last - face->side_first;
    PetscReal            *A    = S + first[f];

    for (PetscInt j = 0; j < rows; j++)
      for (PetscInt i = 0; i < rows; i++) {
        const PetscInt a = at[inter->side_dof[face->side_first + i] - top], b = at[inter->side_dof[face->side_first + j] - top];

        A[i + rows * j] = 0.5 * (F[a + gamma * b] + F[b + gamma * a]);
      }
    PetscCall(LatinSPDInverse_Private(rows, A, bad));
  }
  PetscFunctionReturn(0);
}

/* Stores the Schur complement F (gamma x gamma, rows kept[]) of subdomain s for its local low-energy fields */
static PetscErrorCode LatinSchurStore_Private(LatinDirections *dir, PetscInt s, PetscInt gamma, const PetscInt kept[], const PetscReal F[])
{
  LatinSchur *schur = &dir->schur[s];

  PetscFunctionBegin;
  schur->n = gamma;
  PetscCall(PetscMalloc2(gamma, &schur->row, (size_t)gamma * (size_t)gamma, &schur->S));
  PetscCall(PetscArraycpy(schur->row, kept, gamma));
  PetscCall(PetscArraycpy(schur->S, F, (size_t)gamma * (size_t)gamma));
  PetscFunctionReturn(0);
}

/* Destroys the Schur complements of the subdomains */
PetscErrorCode LatinSchurReset_Private(LatinDirections *dir)
{
  PetscFunctionBegin;
  for (PetscInt s = 0; s < dir->sub->n && dir->schur; s++) PetscCall(PetscFree2(dir->schur[s].row, dir->schur[s].S));
  PetscCall(PetscFree(dir->schur));
  PetscFunctionReturn(0);
}

/*
   Lists the rows that the Schur complement of n subdomains with one operator keeps: on an interface of any of them or, if Schur complements are stored,
   primal. Returns their number; kept[]: the rows, increasing; at[row]: their positions, -1 before
*/
static PetscInt LatinStiffnessRows(const LatinDirections *dir, PetscInt n, const PetscInt list[], PetscInt at[], PetscInt kept[])
{
  const LatinSubdomains *sub   = dir->sub;
  const LatinInterfaces *inter = dir->inter;
  const PetscInt         rows  = sub->bs * (sub->node_offset[list[0] + 1] - sub->node_offset[list[0]]);
  PetscInt               gamma = 0;

  for (PetscInt p = 0; p < n; p++) {
    const PetscInt s = list[p], top = sub->bs * sub->node_offset[s];

    for (PetscInt k = inter->interface[inter->offset[s]].side_first; k < inter->interface[inter->offset[s + 1] - 1].side_last; k++) at[inter->side_dof[k] - top] = 0;
    for (PetscInt k = inter->primal_offset[s]; k < inter->primal_offset[s + 1] && dir->schur; k++) at[inter->primal_dof[k] - top] = 0;
  }
  for (PetscInt r = 0; r < rows; r++)
    if (at[r] == 0) {
      at[r]         = gamma;
      kept[gamma++] = r;
    }
  return gamma;
}

/*
   Computes the Schur complements on the interfaces of n subdomains list[] with the same operator. Rows on an interface of any of them are kept, the
   others are eliminated once, and the rest is dense: so equal sides of different subdomains get equal bits. The foundation of the kept rows, which is
   set to zero in spring[], is added after the elimination. at[]: work, -1 before and after. *bad: a matrix is not positive definite
*/
static PetscErrorCode LatinStiffnessCondense_Private(LatinDirections *dir, PetscInt n, const PetscInt list[], PetscReal spring[], PetscInt at[], const size_t first[], PetscReal S[], PetscBool *bad)
{
  const LatinSubdomains *sub = dir->sub;
  const PetscInt         top = sub->bs * sub->node_offset[list[0]], rows = sub->bs * sub->node_offset[list[0] + 1] - top;
  PetscInt               gamma, *kept;
  PetscReal             *F, *foundation;
  LatinSparse            K;

  PetscFunctionBegin;
  PetscCall(PetscMalloc2(rows, &kept, rows, &foundation));
  gamma = LatinStiffnessRows(dir, n, list, at, kept);
  for (PetscInt k = 0; k < gamma; k++) {
    foundation[k]         = spring[top + kept[k]];
    spring[top + kept[k]] = 0.0;
  }
  PetscCall(PetscMalloc1((size_t)gamma * (size_t)gamma, &F));
  if (sub->ki && gamma == rows) LatinOperatorDense(sub, list[0], gamma, at, F); /* no interior */
  else {
    PetscCall(LatinSparseCreate_Private(sub, list[0], spring, sub->fixed, 0, NULL, &K));
    PetscCall(LatinEliminate_Private(&K, gamma, kept, F, bad));
    PetscCall(LatinSparseReset_Private(&K));
    if (dir->schur && !*bad) PetscCall(LatinSchurStore_Private(dir, list[0], gamma, kept, F));
  }
  for (PetscInt k = 0; k < gamma; k++) F[(size_t)k * ((size_t)gamma + 1)] += foundation[k];
  PetscCall(LatinSPDInverse_Private(gamma, F, bad));
  for (PetscInt p = 0; p < n && !*bad; p++) PetscCall(LatinStiffnessSchur_Private(dir, list[p], gamma, F, at, first, S, bad));
  for (PetscInt k = 0; k < gamma; k++) at[kept[k]] = -1;
  PetscCall(PetscFree(F));
  PetscCall(PetscFree2(kept, foundation));
  PetscFunctionReturn(0);
}

/* The same for n subdomains list[], sorted by their operators same[] */
static PetscErrorCode LatinStiffnessCondenseAll_Private(LatinDirections *dir, PetscInt n, const PetscInt list[], const PetscInt same[], PetscReal spring[], PetscInt at[], const size_t first[], PetscReal S[], PetscBool *bad)
{
  PetscFunctionBegin;
  for (PetscInt p = 0, q; p < n && !*bad; p = q) {
    for (q = p + 1; q < n && same[q] == same[p];) q++;
    PetscCall(LatinStiffnessCondense_Private(dir, q - p, list + p, spring, at, first, S, bad));
  }
  PetscFunctionReturn(0);
}

/*
   Computes *S + first[f], the stiffness of its own subdomain at each interface side with matrices[f], column-major, stored once for equal subdomains.
   blocks: diagonal blocks of B^t k B, else Schur complements. The caller frees *S. Sets dir->like, and dir->schur if low-energy fields may use it.
   Collective on sub->object.
*/
PetscErrorCode LatinStiffnessFaces_Private(LatinDirections *dir, PetscBool blocks, const PetscBool matrices[], size_t first[], PetscReal **S)
{
  const LatinSubdomains *sub   = dir->sub;
  const LatinInterfaces *inter = dir->inter;
  const PetscInt         bs = dir->sub->bs, n = bs * sub->copies;
  PetscInt              *pattern, *same, *list, *key, *at, patterns = 0;
  PetscReal             *spring;
  PetscBool             *wanted, bad = PETSC_FALSE;
  size_t                 used = 0;
  LatinSparse            K;

  PetscFunctionBegin;
  PetscCall(PetscMalloc5(sub->n, &same, sub->n, &list, sub->n, &key, n, &at, n, &spring));
  PetscCall(PetscCalloc1(sub->n, &wanted));
  PetscCall(PetscFree(dir->like));
  PetscCall(PetscMalloc1(sub->n, &dir->like));
  PetscCall(LatinRepeatsLike_Private(dir->inter, same, dir->like));
  if (sub->matrix && LatinDirectionIsDeluxe(dir) && !blocks) PetscCall(PetscCalloc1(sub->n, &dir->schur));
  pattern = dir->like;
  for (PetscInt i = 0; i < n; i++) at[i] = -1;
  for (PetscInt f = 0; f < inter->count; f++) wanted[pattern[inter->interface[f].sub]] = (PetscBool)(wanted[pattern[inter->interface[f].sub]] || matrices[f]);
  for (PetscInt s = 0; s < sub->n; s++) {
    if (pattern[s] == s && wanted[s]) {
      key[patterns]    = sub->preconditions ? s : same[s]; /* the foundation of PC latin depends on the sides */
      list[patterns++] = s;
    }
    for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++) {
      const size_t rows = (size_t)(inter->interface[f].side_last - inter->interface[f].side_first);

      first[f] = pattern[s] == s ? used : first[inter->offset[pattern[s]] + f - inter->offset[s]];
      if (pattern[s] == s && wanted[s]) used += rows * rows;
    }
  }
  PetscCall(PetscMalloc1(used, S));
  PetscCall(LatinStiffnessFoundation_Private(dir, spring));
  PetscCall(PetscSortIntWithArray(patterns, key, list));
  if (!blocks) LatinEach(PetscObjectComm(dir->sub->object), LatinStiffnessCondenseAll_Private(dir, patterns, list, key, spring, at, first, *S, &bad));
  for (PetscInt p = 0; p < patterns && blocks; p++) {
    for (PetscInt f = inter->offset[list[p]]; f < inter->offset[list[p] + 1] && inter->condensed; f++) LatinStiffnessDense(dir, spring, &inter->interface[f], at, *S + first[f]);
    if (inter->condensed) continue;
    PetscCall(LatinSparseCreate_Private(sub, list[p], spring, sub->fixed, 0, NULL, &K));
    for (PetscInt f = inter->offset[list[p]]; f < inter->offset[list[p] + 1]; f++) LatinStiffnessBlock(dir, &K, &inter->interface[f], at, *S + first[f]);
    PetscCall(LatinSparseReset_Private(&K));
  }
  PetscCall(PetscFree5(same, list, key, at, spring));
  PetscCall(PetscFree(wanted));
  LatinAgree(
    PetscObjectComm(dir->sub->object), bad, LatinSubdomainsTried(sub) ? PETSC_ERR_MAT_CH_ZRPVT : PETSC_ERR_CONV_FAILED,
    "The stiffness of a subdomain on its interfaces could not be computed: its matrix is not positive semidefinite, as where prestress compresses links, or after MatConvert() of a whole matrix to a MATIS, or rounding is large. Take another -%sdirection, e.g. diagonal, or -%svariant primal",
    LatinPrefix(dir->sub), LatinPrefix(dir->sub));
  PetscFunctionReturn(0);
}
