#include "base/room.h"
#include "coarse/tree.h"
#include <petsc/private/matimpl.h>

/*
   Elimination along the tree of treeplan.c. A rank eliminates what it alone has of its part; what is left, a dense matrix of the
   unknowns that it shares, joins that of its partner, and what the two alone have is eliminated; and so on. With i these unknowns,
   b the others:

     K_ii = L L^t,   Z = K_bi L^-t,   S = K_bb - Z Z^t, which joins the next one;
     forward: y = L^-1 g_i,   g_b - Z y is sent;   backward: u_b comes back,   u_i = L^-t (y - Z^t u_b).

   So a solve takes one message each way for each of the groups that join, and a rank keeps no more than the columns of one joint.
*/

/*
   What is left of a part or front, symmetric: its lower triangle, in the order of the numbers of its rows, by panels of columns, see
   LatinPanelAt(); of a part they are one column wide. 64 columns are a message: large enough to be all bandwidth, small beside a front
*/
typedef struct {
  PetscInt     n, wide;
  PetscScalar *a;
  PetscScalar *own;  /* to be freed: a */
  Mat          part; /* or this, to be destroyed */
} LatinLeft;

static PetscErrorCode LatinLeftFree_Private(LatinLeft *left)
{
  PetscFunctionBegin;
  PetscCall(PetscFree(left->own));
  PetscCall(MatDestroy(&left->part));
  PetscFunctionReturn(0);
}

/* Columns j to last, of one message, one after the other; returns their entries. They are emptied: it goes, column by column, as what it joins comes */
static PetscInt LatinLeftPack(const LatinLeft *left, PetscInt j, PetscInt last, PetscScalar to[])
{
  const size_t start = LatinPanelSize(left->wide, left->n, j), end = LatinPanelSize(left->wide, left->n, last);
  PetscInt     k = 0;

  for (PetscInt c = j; c < last; c++) {
    const PetscScalar *a = left->a + LatinPanelColumnAt(left->wide, left->n, c);

    for (PetscInt i = c; i < left->n; i++) to[k++] = a[i];
  }
  LatinRoomEmpty(left->a + start, (end - start) * sizeof(*left->a));
  return k;
}

/* Such columns join a front: its interior columns L, and S of the others */
static void LatinJointAdd(const LatinJoint *joint, PetscInt n, const PetscInt at[], PetscInt j, PetscInt last, const PetscScalar from[], PetscScalar L[], PetscScalar S[])
{
  const PetscInt in = joint->interior;

  for (; j < last; j++)
    for (PetscInt i = j; i < n; i++) {
      const PetscInt r = PetscMax(at[i], at[j]), c = PetscMin(at[i], at[j]);

      if (c < in) L[LatinPanelColumnAt(LATIN_FRONT_PANEL, joint->rows, c) + (size_t)r] += *from++;
      else S[LatinPanelColumnAt(LATIN_FRONT_PANEL, joint->rows - in, c - in) + (size_t)(r - in)] += *from++;
    }
}

/* What the interior columns before row r of a front leave on some columns from there on */
static PetscErrorCode LatinJointTake_Private(const LatinJoint *joint, const PetscScalar L[], PetscInt r, PetscInt some, PetscScalar to[])
{
  const PetscScalar  one = 1.0, minus = -1.0;
  const PetscBLASInt height = (PetscBLASInt)(joint->rows - r), columns = (PetscBLASInt)some;

  PetscFunctionBegin;
  for (PetscInt c = 0; c < PetscMin(r, joint->interior); c += LATIN_FRONT_PANEL) {
    const PetscBLASInt wide = (PetscBLASInt)PetscMin(LATIN_FRONT_PANEL, joint->interior - c), ld = (PetscBLASInt)(joint->rows - c);
    const PetscScalar *Z = L + LatinPanelColumnAt(LATIN_FRONT_PANEL, joint->rows, c) + r;

    PetscCallBLAS("BLASgemm", BLASgemm_("N", "T", &height, &columns, &wide, &minus, Z, &ld, Z, &ld, &one, to, &height));
  }
  PetscFunctionReturn(0);
}

/* Eliminates the interior rows of a front, panel by panel; *bad: it is not positive definite */
static PetscErrorCode LatinJointEliminate_Private(const LatinJoint *joint, PetscScalar L[], PetscScalar S[], PetscBool *bad)
{
  const PetscScalar one = 1.0;
  const PetscInt    in = joint->interior, out = joint->rows - in;

  PetscFunctionBegin;
  for (PetscInt c = 0; c < in; c += LATIN_FRONT_PANEL) {
    const PetscBLASInt wide = (PetscBLASInt)PetscMin(LATIN_FRONT_PANEL, in - c), height = (PetscBLASInt)(joint->rows - c), below = height - wide;
    PetscScalar       *panel = L + LatinPanelAt(LATIN_FRONT_PANEL, joint->rows, c);
    PetscBLASInt       info  = 0;

    PetscCall(LatinJointTake_Private(joint, L, c, wide, panel));
    PetscCallBLAS("LAPACKpotrf", LAPACKpotrf_("L", &wide, panel, &height, &info));
    if (info) { /* the next one waits for S all the same */
      *bad = PETSC_TRUE;
      PetscFunctionReturn(0);
    }
    if (below) PetscCallBLAS("BLAStrsm", BLAStrsm_("R", "L", "T", "N", &below, &wide, &one, panel, &height, panel + wide, &height));
    for (PetscInt k = 1; k < wide; k++) PetscCall(PetscArrayzero(panel + (size_t)height * (size_t)k, k));
  }
  for (PetscInt c = 0; c < out; c += LATIN_FRONT_PANEL) PetscCall(LatinJointTake_Private(joint, L, in + c, PetscMin(LATIN_FRONT_PANEL, out - c), S + LatinPanelAt(LATIN_FRONT_PANEL, out, c)));
  PetscCall(PetscLogFlops((double)in * ((double)in * in / 3.0 + (double)in * out + (double)out * out)));
  PetscFunctionReturn(0);
}

/* The front as one of localsolvers/fronts.c, whose lists are those of all rows */
static PetscErrorCode LatinJointFront_Private(LatinJoint *joint)
{
  const PetscInt rows = joint->rows;

  PetscFunctionBegin;
  if (joint->order) PetscFunctionReturn(0);
  PetscCall(PetscMalloc1(rows, &joint->order));
  for (PetscInt r = 0; r < rows; r++) joint->order[r] = r;
  joint->first[0] = 0;
  joint->first[1] = rows;
  PetscCall(LatinFrontsCreate(rows, rows - joint->interior, 1, joint->order, joint->first, joint->first, joint->order, &joint->front));
  PetscFunctionReturn(0);
}

/* The factor of a front from its interior columns; rounded, if single precision holds their pivots */
static PetscErrorCode LatinJointKeep_Private(LatinJoint *joint, PetscBool rounded, PetscScalar L[])
{
  PetscFunctionBegin;
  for (PetscInt c = 0; c < joint->interior && rounded; c++) rounded = LatinFrontPivot(L[LatinPanelColumnAt(LATIN_FRONT_PANEL, joint->rows, c) + (size_t)c]);
  PetscCall(LatinFrontsFill(&joint->front, rounded ? LATIN_ROUNDED : LATIN_DOUBLE, L));
  PetscFunctionReturn(0);
}

/* What a part leaves that has rows of its own, which its factor eliminates; takes K over. at[]: rows of the part; they become those of what is left */
static PetscErrorCode LatinTreeSparse_Private(LatinTree *tree, Mat K, LatinLeft *left, PetscInt at[], PetscBool *bad)
{
  MatFactorInfo info;
  PetscInt     *place;
  PetscBool     sparse;
  Mat           A;
  IS            kept;

  PetscFunctionBegin;
  PetscCall(PetscObjectTypeCompare((PetscObject)K, MATSEQAIJ, &sparse));
  if (sparse) A = K;
  else {
    PetscCall(MatConvert(K, MATSEQAIJ, MAT_INITIAL_MATRIX, &A));
    PetscCall(MatDestroy(&K));
  }
  PetscCall(MatFactorInfoInitialize(&info));
  if (!tree->part) {
    PetscCall(MatGetFactor(A, LATIN_CHOLESKY, MAT_FACTOR_CHOLESKY, &tree->part));
    PetscCall(ISCreateGeneral(PETSC_COMM_SELF, tree->rest, tree->row, PETSC_COPY_VALUES, &kept));
    if (tree->rest) PetscCall(MatFactorSetSchurIS(tree->part, kept));
    PetscCall(LatinCholeskyGives(tree->part));
    PetscCall(ISDestroy(&kept));
    PetscCall(MatCholeskyFactorSymbolic(tree->part, A, NULL, &info));
  }
  PetscCall(MatCholeskyFactorNumeric(tree->part, A, &info));
  *bad = (PetscBool)(tree->part->factorerrortype != MAT_FACTOR_NOERROR);
  PetscCall(MatDestroy(&A));
  PetscCall(LatinCholeskyGiveLower(tree->part, &left->own));
  left->a = left->own;
  PetscCall(PetscCalloc1(tree->n, &place)); /* in the Schur complement, whose rows ascend as in the part */
  for (PetscInt i = 0; i < tree->rest; i++) place[tree->row[i]] = 1;
  for (PetscInt r = 0, k = 0; r < tree->n; r++)
    if (place[r]) place[r] = k++;
  for (PetscInt i = 0; i < tree->rest; i++) at[i] = place[at[i]];
  PetscCall(PetscFree(place));
  PetscFunctionReturn(0);
}

/* What a part leaves without rows of its own: itself. Takes K over, and its place, unless others have it */
static PetscErrorCode LatinTreeDense_Private(LatinTree *tree, Mat K, LatinLeft *left)
{
  const size_t n      = (size_t)tree->rest;
  PetscInt     owners = 1, ld;
  PetscBool    dense, lower;
  PetscScalar *from;

  PetscFunctionBegin;
  left->part = K;
  PetscCall(PetscObjectTypeCompare((PetscObject)K, MATSHELL, &lower));
  if (lower) PetscCall(MatShellGetContext(K, &left->a));
  if (lower) PetscFunctionReturn(0);
  PetscCall(PetscObjectTypeCompare((PetscObject)K, MATSEQDENSE, &dense));
  if (dense) PetscCall(PetscObjectGetReference((PetscObject)K, &owners));
  else {
    PetscCall(MatConvert(K, MATSEQDENSE, MAT_INITIAL_MATRIX, &left->part));
    PetscCall(MatDestroy(&K));
  }
  PetscCall(MatDenseGetLDA(left->part, &ld));
  PetscCall(MatDenseGetArrayRead(left->part, (const PetscScalar **)&from)); /* which the matrix keeps */
  if (owners > 1) PetscCall(PetscMalloc1(LatinPanelSize(1, tree->rest, tree->rest), &left->own));
  left->a = owners > 1 ? left->own : from;
  for (size_t c = 0; c < n; c++)
    for (size_t r = c; r < n; r++) left->a[LatinLowerAt(tree->rest, (PetscInt)c) + r] = from[r + (size_t)ld * c];
  if (owners > 1) PetscCall(MatDestroy(&left->part));
  else LatinRoomEmpty(from + LatinPanelSize(1, tree->rest, tree->rest), ((size_t)ld * n - LatinPanelSize(1, tree->rest, tree->rest)) * sizeof(*from));
  PetscFunctionReturn(0);
}

/* Row at[r] of a lower triangle becomes row r, and columns as well: in place, for a front is to have room beside it */
static PetscErrorCode LatinLeftOrder_Private(PetscInt n, const PetscInt at[], PetscScalar a[])
{
  PetscBool sorted = PETSC_TRUE;
  char     *there; /* for each entry */

  PetscFunctionBegin;
  for (PetscInt r = 0; r < n && sorted; r++) sorted = (PetscBool)(at[r] == r);
  if (sorted) PetscFunctionReturn(0);
  PetscCall(PetscCalloc1(LatinPanelSize(1, n, n), &there));
  for (PetscInt c = 0; c < n; c++)
    for (PetscInt r = c; r < n; r++) {
      const size_t      start = LatinLowerAt(n, c) + (size_t)r;
      const PetscScalar first = a[start];
      size_t            to    = start;

      for (PetscInt i = r, j = c; !there[to];) { /* a cycle */
        const PetscInt high = PetscMax(at[i], at[j]), low = PetscMin(at[i], at[j]);
        const size_t   from = LatinLowerAt(n, low) + (size_t)high;

        there[to] = 1;
        a[to]     = from == start ? first : a[from];
        to        = from;
        i         = high;
        j         = low;
      }
    }
  PetscCall(PetscFree(there));
  PetscFunctionReturn(0);
}

/* What the part of this rank leaves. Takes K over */
static PetscErrorCode LatinTreePart_Private(LatinTree *tree, Mat K, LatinLeft *left, PetscBool *bad)
{
  PetscInt *at;

  PetscFunctionBegin;
  *left = (LatinLeft){.n = tree->rest, .wide = 1};
  PetscCall(PetscMalloc1(tree->rest, &at));
  PetscCall(PetscArraycpy(at, tree->row, tree->rest));
  if (tree->rest < tree->n) PetscCall(LatinTreeSparse_Private(tree, K, left, at, bad));
  else PetscCall(LatinTreeDense_Private(tree, K, left));
  PetscCall(LatinLeftOrder_Private(tree->rest, at, left->a));
  PetscCall(PetscFree(at));
  PetscFunctionReturn(0);
}

/* What is left goes to another rank, and is freed */
static PetscErrorCode LatinLeftSend_Private(const LatinTree *tree, PetscMPIInt to, LatinLeft *left, PetscScalar buffer[])
{
  PetscMPIInt length;

  PetscFunctionBegin;
  for (PetscInt j = 0; j < left->n && to >= 0; j += LATIN_FRONT_PANEL) {
    PetscCall(PetscMPIIntCast(LatinLeftPack(left, j, PetscMin(j + LATIN_FRONT_PANEL, left->n), buffer), &length));
    PetscCallMPI(MPI_Send(buffer, length, MPIU_SCALAR, to, 0, tree->comm));
  }
  PetscCall(LatinLeftFree_Private(left));
  PetscFunctionReturn(0);
}

/* The front of the joint from what comes and what is left here, which goes first; eliminated, it leaves the next */
static PetscErrorCode LatinTreeJoin_Private(LatinTree *tree, PetscBool rounded, LatinLeft *left, PetscScalar buffer[], PetscBool *bad)
{
  LatinJoint    *joint = tree->joint;
  const PetscInt out   = joint->rows - joint->interior;
  PetscMPIInt    length;
  PetscScalar   *L, *S;

  PetscFunctionBegin;
  PetscCall(LatinJointFront_Private(joint));
  PetscCall(LatinRoomDestroy_Private(&joint->front.factor));
  PetscCall(PetscMalloc1(joint->front.panel[1], &L));
  PetscCall(PetscMalloc1(LatinPanelSize(LATIN_FRONT_PANEL, out, out), &S));
  LatinRoomZero(L, joint->front.panel[1] * sizeof(*L));
  LatinRoomZero(S, LatinPanelSize(LATIN_FRONT_PANEL, out, out) * sizeof(*S));
  for (PetscInt p = 0; p < 2; p++) {
    const PetscInt  k   = joint->from[1] == tree->rank ? 1 - p : p;
    const PetscBool own = (PetscBool)(joint->from[k] == tree->rank);

    for (PetscInt j = 0; j < joint->n[k]; j += LATIN_FRONT_PANEL) {
      const PetscInt last = PetscMin(j + LATIN_FRONT_PANEL, joint->n[k]);

      PetscCall(PetscMPIIntCast(LATIN_FRONT_PANEL * joint->n[k], &length));
      if (own) (void)LatinLeftPack(left, j, last, buffer);
      else PetscCallMPI(MPI_Recv(buffer, length, MPIU_SCALAR, joint->from[k], 0, tree->comm, MPI_STATUS_IGNORE));
      LatinJointAdd(joint, joint->n[k], joint->at + (k ? joint->n[0] : 0), j, last, buffer, L, S);
    }
    if (own) PetscCall(LatinLeftFree_Private(left));
  }
  PetscCall(LatinJointEliminate_Private(joint, L, S, bad));
  *left = (LatinLeft){.n = out, .wide = LATIN_FRONT_PANEL, .a = S, .own = S};
  PetscCall(LatinLeftSend_Private(tree, joint->to, left, buffer)); /* before the next one waits for more */
  PetscCall(LatinJointKeep_Private(joint, rounded, L));
  PetscCall(PetscFree(L));
  PetscFunctionReturn(0);
}

/* The factor of the sum of the parts K, which it takes over, its fronts rounded to single precision or not; on all ranks *bad or on none. Collective on tree->comm */
PetscErrorCode LatinTreeFactor_Private(LatinTree *tree, PetscBool rounded, Mat K, PetscBool *bad)
{
  PetscScalar *buffer;
  LatinLeft    left;

  PetscFunctionBegin;
  *bad = PETSC_FALSE;
  PetscCall(PetscMalloc1(LATIN_FRONT_PANEL * PetscMax(tree->rest, tree->joint ? tree->joint->rows : 0), &buffer));
  PetscCall(LatinTreePart_Private(tree, K, &left, bad));
  if (tree->to != tree->rank) {
    PetscCall(LatinLeftSend_Private(tree, tree->to, &left, buffer));
    LatinRoomReturn((size_t)tree->rest * (size_t)tree->rest * sizeof(*buffer)); /* before a front comes */
  }
  if (tree->joint) PetscCall(LatinTreeJoin_Private(tree, rounded, &left, buffer, bad));
  PetscCall(PetscFree(buffer));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, bad, 1, LATIN_MPI_BOOL, MPI_LOR, tree->comm));
  PetscFunctionReturn(0);
}

/* The forces w of the group, or (back) its displacements, from one rank to another; nothing where they stay */
static PetscErrorCode LatinTreePass_Private(const LatinTree *tree, PetscMPIInt other, PetscInt n, PetscBool send)
{
  PetscMPIInt length;

  PetscFunctionBegin;
  if (other < 0 || other == tree->rank) PetscFunctionReturn(0);
  PetscCall(PetscMPIIntCast(n, &length));
  if (send) PetscCallMPI(MPI_Send(tree->w, length, MPIU_SCALAR, other, 0, tree->comm));
  else PetscCallMPI(MPI_Recv(tree->w, length, MPIU_SCALAR, other, 0, tree->comm, MPI_STATUS_IGNORE));
  PetscFunctionReturn(0);
}

/* The forces of both groups join; what the joint leaves goes on, displacements come back there, and those of both groups go back to them. w: in, forces that the part here leaves; out, their displacements, where the joint is that of the part */
static PetscErrorCode LatinTreeJoint_Private(LatinTree *tree)
{
  LatinJoint    *joint = tree->joint;
  const PetscInt out   = joint->rows - joint->interior;
  PetscScalar   *w     = tree->w;

  PetscFunctionBegin;
  PetscCall(PetscArrayzero(joint->x, joint->rows));
  for (PetscInt p = 0; p < 2; p++) { /* what is here first: w is taken by what comes */
    const PetscInt  k  = joint->from[1] == tree->rank ? 1 - p : p;
    const PetscInt *at = joint->at + (k ? joint->n[0] : 0);

    PetscCall(LatinTreePass_Private(tree, joint->from[k], joint->n[k], PETSC_FALSE));
    for (PetscInt i = 0; i < joint->n[k]; i++) joint->x[at[i]] += w[i];
  }
  PetscCall(LatinFrontsSolve(&joint->front, PETSC_TRUE, PETSC_FALSE, 1, joint->x, 0, NULL));
  PetscCall(PetscArraycpy(w, joint->x + joint->interior, out));
  PetscCall(LatinTreePass_Private(tree, joint->to, out, PETSC_TRUE));
  PetscCall(LatinTreePass_Private(tree, joint->to, out, PETSC_FALSE));
  PetscCall(PetscArraycpy(joint->x + joint->interior, w, out));
  PetscCall(LatinFrontsSolve(&joint->front, PETSC_FALSE, PETSC_TRUE, 1, joint->x, 0, NULL));
  for (PetscInt p = 0; p < 2; p++) { /* and last */
    const PetscInt  k  = joint->from[1] == tree->rank ? p : 1 - p;
    const PetscInt *at = joint->at + (k ? joint->n[0] : 0);

    for (PetscInt i = 0; i < joint->n[k]; i++) w[i] = joint->x[at[i]];
    PetscCall(LatinTreePass_Private(tree, joint->from[k], joint->n[k], PETSC_TRUE));
  }
  PetscFunctionReturn(0);
}

/* x = A^-1 b, of which each rank has its own rows. Collective on tree->comm */
PetscErrorCode LatinTreeSolve_Private(LatinTree *tree, const PetscScalar b[], PetscScalar x[])
{
  PetscReal energy = 0.0;

  PetscFunctionBegin;
  for (PetscInt r = 0; r < tree->n; r++) tree->g[r] = tree->owned[r] < 0 ? 0.0 : b[tree->owned[r]];
  if (tree->part) PetscCall(LatinCholeskyForward(tree->part, tree->g, &energy));
  for (PetscInt i = 0; i < tree->rest; i++) tree->w[i] = tree->g[tree->row[i]];
  PetscCall(LatinTreePass_Private(tree, tree->to, tree->rest, PETSC_TRUE));
  if (tree->joint) PetscCall(LatinTreeJoint_Private(tree));
  PetscCall(LatinTreePass_Private(tree, tree->to, tree->rest, PETSC_FALSE));
  for (PetscInt i = 0; i < tree->rest; i++) tree->g[tree->row[i]] = tree->w[i];
  if (tree->part) PetscCall(LatinCholeskyBackward(tree->part, tree->g, &energy));
  for (PetscInt r = 0; r < tree->n; r++)
    if (tree->owned[r] >= 0) x[tree->owned[r]] = tree->g[r];
  PetscFunctionReturn(0);
}

PetscErrorCode LatinTreeReset_Private(LatinTree *tree)
{
  PetscFunctionBegin;
  if (tree->joint) {
    PetscCall(PetscFree(tree->joint->at));
    PetscCall(PetscFree(tree->joint->order));
    PetscCall(LatinFrontsDestroy(&tree->joint->front));
    PetscCall(PetscFree(tree->joint->x));
  }
  PetscCall(PetscFree(tree->joint));
  PetscCall(PetscFree2(tree->owned, tree->row));
  PetscCall(PetscFree2(tree->g, tree->w));
  PetscCall(MatDestroy(&tree->part));
  if (tree->comm != MPI_COMM_NULL) PetscCallMPI(MPI_Comm_free(&tree->comm));
  tree->comm = MPI_COMM_NULL;
  PetscFunctionReturn(0);
}
