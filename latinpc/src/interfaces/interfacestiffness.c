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

/* Matrices of the interfaces while they are computed */
typedef struct {
  PetscReal    *spring; /* [copies][bs] foundation */
  PetscInt     *at;     /* [copies][bs] work, -1 before and after: position of a row */
  const size_t *first;  /* [interfaces] start of the matrix of each in S */
  PetscReal    *S;
  PetscBool     bad; /* one is not positive definite */
} LatinStiffness;

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

/* Computes the Schur complement on each interface of subdomain s from F, the inverse (gamma x gamma) of that on the rows at work->at[] */
static PetscErrorCode LatinStiffnessSchur_Private(const LatinDirections *dir, PetscInt s, PetscInt gamma, const PetscReal F[], LatinStiffness *work)
{
  const LatinInterfaces *inter = dir->inter;
  const PetscInt         top   = dir->sub->bs * dir->sub->node_offset[s];

  PetscFunctionBegin;
  for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++) {
    const LatinInterface *face = &inter->interface[f];
    const PetscInt        rows = face->side_last - face->side_first;
    PetscReal            *A    = work->S + work->first[f];

    for (PetscInt j = 0; j < rows; j++)
      for (PetscInt i = 0; i < rows; i++) {
        const PetscInt a = work->at[inter->side_dof[face->side_first + i] - top], b = work->at[inter->side_dof[face->side_first + j] - top];

        A[i + rows * j] = 0.5 * (F[a + gamma * b] + F[b + gamma * a]);
      }
    PetscCall(LatinSPDInverse_Private(rows, A, &work->bad));
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
   set to zero in work->spring, is added after the elimination
*/
static PetscErrorCode LatinStiffnessCondense_Private(LatinDirections *dir, PetscInt n, const PetscInt list[], LatinStiffness *work)
{
  const LatinSubdomains *sub = dir->sub;
  const PetscInt         top = sub->bs * sub->node_offset[list[0]], rows = sub->bs * sub->node_offset[list[0] + 1] - top;
  PetscInt               gamma, *kept;
  PetscReal             *F, *foundation, *spring = work->spring + top;
  LatinSparse            K;

  PetscFunctionBegin;
  PetscCall(PetscMalloc2(rows, &kept, rows, &foundation));
  gamma = LatinStiffnessRows(dir, n, list, work->at, kept);
  for (PetscInt k = 0; k < gamma; k++) {
    foundation[k]   = spring[kept[k]];
    spring[kept[k]] = 0.0;
  }
  PetscCall(PetscMalloc1((size_t)gamma * (size_t)gamma, &F));
  if (sub->ki && gamma == rows) LatinOperatorDense(sub, list[0], gamma, work->at, F); /* no interior */
  else {
    PetscCall(LatinSparseCreate_Private(sub, list[0], work->spring, sub->fixed, 0, NULL, &K));
    PetscCall(LatinEliminate_Private(&K, gamma, kept, F, &work->bad));
    PetscCall(LatinSparseReset_Private(&K));
    if (dir->schur && !work->bad) PetscCall(LatinSchurStore_Private(dir, list[0], gamma, kept, F));
  }
  for (PetscInt k = 0; k < gamma; k++) F[(size_t)k * ((size_t)gamma + 1)] += foundation[k];
  PetscCall(LatinSPDInverse_Private(gamma, F, &work->bad));
  for (PetscInt p = 0; p < n && !work->bad; p++) PetscCall(LatinStiffnessSchur_Private(dir, list[p], gamma, F, work));
  for (PetscInt k = 0; k < gamma; k++) work->at[kept[k]] = -1;
  PetscCall(PetscFree(F));
  PetscCall(PetscFree2(kept, foundation));
  PetscFunctionReturn(0);
}

/* The same for n subdomains list[], sorted by their operators */
static PetscErrorCode LatinStiffnessCondenseAll_Private(LatinDirections *dir, PetscInt n, const PetscInt list[], const PetscInt operator[], LatinStiffness *work)
{
  PetscFunctionBegin;
  for (PetscInt p = 0, q; p < n && !work->bad; p = q) {
    for (q = p + 1; q < n && operator[q] == operator[p];) q++;
    PetscCall(LatinStiffnessCondense_Private(dir, q - p, list + p, work));
  }
  PetscFunctionReturn(0);
}

/* Computes the diagonal blocks of B^t k B at the interfaces of subdomain s, foundation included */
static PetscErrorCode LatinStiffnessBlocks_Private(const LatinDirections *dir, PetscInt s, LatinStiffness *work)
{
  const LatinInterfaces *inter = dir->inter;
  LatinSparse            K;

  PetscFunctionBegin;
  if (inter->condensed) {
    for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++) LatinStiffnessDense(dir, work->spring, &inter->interface[f], work->at, work->S + work->first[f]);
    PetscFunctionReturn(0);
  }
  PetscCall(LatinSparseCreate_Private(dir->sub, s, work->spring, dir->sub->fixed, 0, NULL, &K));
  for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++) LatinStiffnessBlock(dir, &K, &inter->interface[f], work->at, work->S + work->first[f]);
  PetscCall(LatinSparseReset_Private(&K));
  PetscFunctionReturn(0);
}

/*
   Lists the subdomains to compute, one of each pattern of equal ones (dir->like) that has matrices; operator[]: their operators. Sets first[] of all
   interfaces, and returns the number of entries of the matrices. Collective on sub->object
*/
static PetscErrorCode LatinStiffnessList_Private(LatinDirections *dir, const PetscBool matrices[], PetscInt *n, PetscInt list[], PetscInt operator[], size_t first[], size_t *entries)
{
  const LatinSubdomains *sub   = dir->sub;
  const LatinInterfaces *inter = dir->inter;
  PetscInt              *same, *pattern;
  PetscBool             *wanted;

  PetscFunctionBegin;
  PetscCall(PetscFree(dir->like));
  PetscCall(PetscMalloc1(sub->n, &dir->like));
  PetscCall(PetscMalloc1(sub->n, &same));
  PetscCall(LatinRepeatsLike_Private(inter, same, dir->like));
  pattern = dir->like;
  PetscCall(PetscCalloc1(sub->n, &wanted));
  for (PetscInt f = 0; f < inter->count; f++)
    if (matrices[f]) wanted[pattern[inter->interface[f].sub]] = PETSC_TRUE;
  *n       = 0;
  *entries = 0;
  for (PetscInt s = 0; s < sub->n; s++) {
    const PetscBool listed = (PetscBool)(pattern[s] == s && wanted[s]);

    if (listed) {
      operator[*n] = sub->preconditions ? s : same[s]; /* the foundation of PC latin depends on the sides */
      list[(*n)++] = s;
    }
    for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++) {
      const size_t rows = (size_t)(inter->interface[f].side_last - inter->interface[f].side_first);

      first[f] = pattern[s] == s ? *entries : first[inter->offset[pattern[s]] + f - inter->offset[s]];
      if (listed) *entries += rows * rows;
    }
  }
  PetscCall(PetscFree(wanted));
  PetscCall(PetscFree(same));
  PetscFunctionReturn(0);
}

/*
   Computes *S + first[f], the stiffness of its own subdomain at each interface side with matrices[f], column-major, stored once for equal subdomains.
   blocks: diagonal blocks of B^t k B, else Schur complements. The caller frees *S. Sets dir->like, and dir->schur if low-energy fields may use it.
   Collective on sub->object.
*/
PetscErrorCode LatinStiffnessFaces_Private(LatinDirections *dir, PetscBool blocks, const PetscBool matrices[], size_t first[], PetscReal **S)
{
  const LatinSubdomains *sub  = dir->sub;
  const PetscInt         dofs = sub->bs * sub->copies;
  LatinStiffness         work = {.first = first};
  PetscInt              *list, *operator, n;
  size_t                 entries;

  PetscFunctionBegin;
  PetscCall(PetscMalloc4(sub->n, &list, sub->n, &operator, dofs, &work.at, dofs, &work.spring));
  PetscCall(LatinStiffnessList_Private(dir, matrices, &n, list, operator, first, &entries));
  PetscCall(PetscSortIntWithArray(n, operator, list));
  PetscCall(PetscMalloc1(entries, S));
  work.S = *S;
  for (PetscInt i = 0; i < dofs; i++) work.at[i] = -1;
  PetscCall(LatinStiffnessFoundation_Private(dir, work.spring));
  if (blocks) {
    for (PetscInt p = 0; p < n; p++) PetscCall(LatinStiffnessBlocks_Private(dir, list[p], &work));
  } else {
    if (sub->matrix && LatinDirectionIsDeluxe(dir)) PetscCall(PetscCalloc1(sub->n, &dir->schur));
    LatinEach(PetscObjectComm(sub->object), LatinStiffnessCondenseAll_Private(dir, n, list, operator, & work));
  }
  PetscCall(PetscFree4(list, operator, work.at, work.spring));
  LatinAgree(
    PetscObjectComm(sub->object), work.bad, LatinSubdomainsTried(sub) ? PETSC_ERR_MAT_CH_ZRPVT : PETSC_ERR_CONV_FAILED,
    "The stiffness of a subdomain on its interfaces could not be computed: its matrix is not positive semidefinite, as where prestress compresses links, or after MatConvert() of a whole matrix to a MATIS, or rounding is large. Take another -%sdirection, e.g. diagonal, or -%svariant primal",
    LatinPrefix(sub), LatinPrefix(sub));
  PetscFunctionReturn(0);
}
