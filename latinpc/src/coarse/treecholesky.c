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

#define LATIN_TREE_COLUMNS 64 /* of a message: large enough to be all bandwidth, small beside a front */

/*
   What is left of a part or front, symmetric: the lower triangle counts, in the order of the numbers of its rows. Of a part it is a
   matrix whose rows have an order of their own; of a front panels of LATIN_TREE_COLUMNS columns, each from its diagonal on
*/
typedef struct {
  PetscInt           n, ld, *order; /* [n] rows in the matrix; NULL: panels */
  const PetscScalar *a;
  PetscScalar       *own;   /* to be freed: a */
  Mat                dense; /* or this, to be destroyed */
} LatinLeft;

/* Where column j, a multiple of LATIN_TREE_COLUMNS, of n panels begins */
static inline size_t LatinPanelAt(PetscInt n, PetscInt j)
{
  return (size_t)j * (size_t)n - (size_t)j * (size_t)(j - LATIN_TREE_COLUMNS) / 2;
}

static PetscErrorCode LatinLeftFree_Private(LatinLeft *left)
{
  PetscFunctionBegin;
  PetscCall(PetscFree(left->order));
  PetscCall(PetscFree(left->own));
  PetscCall(MatDestroy(&left->dense));
  PetscFunctionReturn(0);
}

/* Columns j to last of the lower triangle, of one panel, one after the other; returns their entries */
static PetscInt LatinLeftPack(const LatinLeft *left, PetscInt j, PetscInt last, PetscScalar to[])
{
  const PetscScalar *panel  = left->order ? NULL : left->a + LatinPanelAt(left->n, j);
  const PetscInt     height = left->n - j;
  PetscInt           k      = 0;

  for (PetscInt c = j; c < last; c++)
    if (left->order) {
      const PetscScalar *a = left->a + (size_t)left->ld * (size_t)left->order[c];

      for (PetscInt i = c; i < left->n; i++) to[k++] = a[left->order[i]];
    } else {
      const PetscScalar *a = panel + (size_t)height * (size_t)(c - j) - j;

      for (PetscInt i = c; i < left->n; i++) to[k++] = a[i];
    }
  return k;
}

/* Such columns join a front: its interior columns L, and S of the others */
static void LatinJointAdd(const LatinJoint *joint, PetscInt n, const PetscInt at[], PetscInt j, PetscInt last, const PetscScalar from[], PetscScalar S[])
{
  const PetscInt in = joint->interior, out = joint->rows - in;

  for (; j < last; j++)
    for (PetscInt i = j; i < n; i++) {
      const PetscInt r = PetscMax(at[i], at[j]), c = PetscMin(at[i], at[j]);

      if (c < in) joint->L[(size_t)r + (size_t)joint->rows * (size_t)c] += *from++;
      else {
        const PetscInt first = (c - in) - (c - in) % LATIN_TREE_COLUMNS, height = out - first;

        S[LatinPanelAt(out, first) + (size_t)(r - in - first) + (size_t)height * (size_t)(c - in - first)] += *from++;
      }
    }
}

/* Eliminates the interior rows of a front; *bad: it is not positive definite */
static PetscErrorCode LatinJointEliminate_Private(LatinJoint *joint, PetscScalar S[], PetscBool *bad)
{
  const PetscScalar one = 1.0, minus = -1.0;
  PetscBLASInt      rows, in, out, info = 0;

  PetscFunctionBegin;
  PetscCall(PetscBLASIntCast(joint->rows, &rows));
  PetscCall(PetscBLASIntCast(joint->interior, &in));
  out = rows - in;
  if (!in) PetscFunctionReturn(0);
  PetscCallBLAS("LAPACKpotrf", LAPACKpotrf_("L", &in, joint->L, &rows, &info));
  if (info) { /* the next one waits for S all the same */
    *bad = PETSC_TRUE;
    PetscFunctionReturn(0);
  }
  if (out) PetscCallBLAS("BLAStrsm", BLAStrsm_("R", "L", "T", "N", &out, &in, &one, joint->L, &rows, joint->L + in, &rows));
  for (PetscInt j = 0; j < out; j += LATIN_TREE_COLUMNS) {
    const PetscBLASInt height = out - j, columns = PetscMin(LATIN_TREE_COLUMNS, height);
    const PetscScalar *Z = joint->L + in + j;

    PetscCallBLAS("BLASgemm", BLASgemm_("N", "T", &height, &columns, &in, &minus, Z, &rows, Z, &rows, &one, S + LatinPanelAt(out, j), &height));
  }
  PetscCall(PetscLogFlops((double)in * ((double)in * in / 3.0 + (double)in * out + (double)out * out)));
  PetscFunctionReturn(0);
}

/* What a part leaves that has rows of its own, which its factor eliminates; takes K over */
static PetscErrorCode LatinTreeSparse_Private(LatinTree *tree, Mat K, LatinLeft *left, PetscBool *bad)
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
    PetscCall(ISDestroy(&kept));
    PetscCall(MatCholeskyFactorSymbolic(tree->part, A, NULL, &info));
  }
  PetscCall(MatCholeskyFactorNumeric(tree->part, A, &info));
  *bad = (PetscBool)(tree->part->factorerrortype != MAT_FACTOR_NOERROR);
  PetscCall(MatDestroy(&A));
  PetscCall(LatinCholeskyGiveSchur(tree->part, &left->own));
  left->a  = left->own;
  left->ld = tree->rest;
  PetscCall(PetscCalloc1(tree->n, &place)); /* in the Schur complement, whose rows ascend as in the part */
  for (PetscInt i = 0; i < tree->rest; i++) place[tree->row[i]] = 1;
  for (PetscInt r = 0, k = 0; r < tree->n; r++)
    if (place[r]) place[r] = k++;
  for (PetscInt i = 0; i < tree->rest; i++) left->order[i] = place[tree->row[i]];
  PetscCall(PetscFree(place));
  PetscFunctionReturn(0);
}

/* What the part of this rank leaves; one without rows of its own that is dense is that already. Takes K over */
static PetscErrorCode LatinTreePart_Private(LatinTree *tree, Mat K, LatinLeft *left, PetscBool *bad)
{
  const PetscScalar *a;
  PetscBool          dense;

  PetscFunctionBegin;
  *left = (LatinLeft){.n = tree->rest};
  PetscCall(PetscMalloc1(tree->rest, &left->order));
  if (tree->rest < tree->n) {
    PetscCall(LatinTreeSparse_Private(tree, K, left, bad));
    PetscFunctionReturn(0);
  }
  PetscCall(PetscArraycpy(left->order, tree->row, tree->rest));
  PetscCall(PetscObjectTypeCompare((PetscObject)K, MATSEQDENSE, &dense));
  if (dense) left->dense = K;
  else {
    PetscCall(MatConvert(K, MATSEQDENSE, MAT_INITIAL_MATRIX, &left->dense));
    PetscCall(MatDestroy(&K));
  }
  PetscCall(MatDenseGetLDA(left->dense, &left->ld));
  PetscCall(MatDenseGetArrayRead(left->dense, &a));
  left->a = a; /* which the matrix keeps */
  PetscCall(MatDenseRestoreArrayRead(left->dense, &a));
  PetscFunctionReturn(0);
}

/* Moves the columns of what a part leaves into the order of the numbers, in place: cycle by cycle */
static PetscErrorCode LatinLeftColumns_Private(const LatinLeft *left, PetscScalar a[], PetscScalar first[])
{
  const size_t ld = (size_t)left->ld;
  PetscBool   *there;

  PetscFunctionBegin;
  PetscCall(PetscCalloc1(left->n, &there));
  for (PetscInt start = 0; start < left->n; start++) {
    if (there[start]) continue;
    PetscCall(PetscArraycpy(first, a + ld * (size_t)start, left->n));
    for (PetscInt c = start; !there[c]; c = left->order[c]) {
      there[c] = PETSC_TRUE;
      PetscCall(PetscArraycpy(a + ld * (size_t)c, there[left->order[c]] ? first : a + ld * (size_t)left->order[c], left->n));
    }
  }
  PetscCall(PetscFree(there));
  PetscFunctionReturn(0);
}

/* What a part leaves, as panels, half of it: a front is to have room beside it. In its place, where nobody else has the matrix: a panel ends no later than its columns do */
static PetscErrorCode LatinLeftHalve_Private(LatinLeft *left)
{
  const PetscInt n = left->n, last = n - n % LATIN_TREE_COLUMNS;
  const size_t   ld = (size_t)left->ld, half = LatinPanelAt(n, last) + (size_t)(n - last) * (size_t)(n - last);
  PetscScalar   *a = (PetscScalar *)left->a, *panels = a, *column;
  PetscInt       owners = 1;

  PetscFunctionBegin;
  if (left->dense) PetscCall(PetscObjectGetReference((PetscObject)left->dense, &owners));
  PetscCall(PetscMalloc1(n, &column));
  if (owners > 1) PetscCall(PetscMalloc1(half, &panels));
  else PetscCall(LatinLeftColumns_Private(left, a, column));
  for (PetscInt c = 0; c < n; c++) {
    const PetscInt j  = c - c % LATIN_TREE_COLUMNS;
    PetscScalar   *to = panels + LatinPanelAt(n, j) + (size_t)(n - j) * (size_t)(c - j) - j;

    PetscCall(PetscArraycpy(column, a + ld * (size_t)(owners > 1 ? left->order[c] : c), n));
    for (PetscInt i = c; i < n; i++) to[i] = column[left->order[i]];
  }
  PetscCall(PetscFree(column));
  if (owners > 1) {
    PetscCall(LatinLeftFree_Private(left));
    *left = (LatinLeft){.n = n, .a = panels, .own = panels};
    PetscFunctionReturn(0);
  }
  PetscCall(PetscFree(left->order));
  LatinRoomEmpty(a + half, (ld * (size_t)n - half) * sizeof(*a));
  PetscFunctionReturn(0);
}

/* What is left goes to another rank, and is freed */
static PetscErrorCode LatinLeftSend_Private(const LatinTree *tree, PetscMPIInt to, LatinLeft *left, PetscScalar buffer[])
{
  PetscMPIInt length;

  PetscFunctionBegin;
  for (PetscInt j = 0; j < left->n && to >= 0; j += LATIN_TREE_COLUMNS) {
    PetscCall(PetscMPIIntCast(LatinLeftPack(left, j, PetscMin(j + LATIN_TREE_COLUMNS, left->n), buffer), &length));
    PetscCallMPI(MPI_Send(buffer, length, MPIU_SCALAR, to, 0, tree->comm));
  }
  PetscCall(LatinLeftFree_Private(left));
  PetscFunctionReturn(0);
}

/* The front of the joint from what comes and what is left here, which is freed; eliminated, it leaves the next */
static PetscErrorCode LatinTreeJoin_Private(LatinTree *tree, LatinLeft *left, PetscScalar buffer[], PetscBool *bad)
{
  LatinJoint    *joint = tree->joint;
  const PetscInt out   = joint->rows - joint->interior;
  PetscMPIInt    length;
  PetscScalar   *S;

  PetscFunctionBegin;
  if (!joint->L) PetscCall(PetscMalloc1((size_t)joint->rows * (size_t)joint->interior, &joint->L));
  PetscCall(PetscArrayzero(joint->L, (size_t)joint->rows * (size_t)joint->interior));
  PetscCall(PetscCalloc1(LatinPanelAt(out, out - out % LATIN_TREE_COLUMNS) + (size_t)(out % LATIN_TREE_COLUMNS) * (size_t)(out % LATIN_TREE_COLUMNS), &S));
  for (PetscInt k = 0; k < 2; k++) {
    const PetscBool own = (PetscBool)(joint->from[k] == tree->rank);

    for (PetscInt j = 0; j < joint->n[k]; j += LATIN_TREE_COLUMNS) {
      const PetscInt last = PetscMin(j + LATIN_TREE_COLUMNS, joint->n[k]);

      PetscCall(PetscMPIIntCast(LATIN_TREE_COLUMNS * joint->n[k], &length));
      if (own) (void)LatinLeftPack(left, j, last, buffer);
      else PetscCallMPI(MPI_Recv(buffer, length, MPIU_SCALAR, joint->from[k], 0, tree->comm, MPI_STATUS_IGNORE));
      LatinJointAdd(joint, joint->n[k], joint->at + (k ? joint->n[0] : 0), j, last, buffer, S);
    }
    if (own) PetscCall(LatinLeftFree_Private(left));
  }
  PetscCall(LatinJointEliminate_Private(joint, S, bad));
  *left = (LatinLeft){.n = out, .a = S, .own = S};
  PetscFunctionReturn(0);
}

/* The factor of the sum of the parts K, which it takes over; on all ranks *bad or on none. Collective on tree->comm */
PetscErrorCode LatinTreeFactor_Private(LatinTree *tree, Mat K, PetscBool *bad)
{
  PetscScalar *buffer;
  LatinLeft    left;

  PetscFunctionBegin;
  *bad = PETSC_FALSE;
  PetscCall(PetscMalloc1(LATIN_TREE_COLUMNS * PetscMax(tree->rest, tree->joint ? tree->joint->rows : 0), &buffer));
  PetscCall(LatinTreePart_Private(tree, K, &left, bad));
  if (tree->to != tree->rank) PetscCall(LatinLeftSend_Private(tree, tree->to, &left, buffer));
  else PetscCall(LatinLeftHalve_Private(&left));
  if (tree->joint) {
    PetscCall(LatinTreeJoin_Private(tree, &left, buffer, bad));
    PetscCall(LatinLeftSend_Private(tree, tree->joint->to, &left, buffer));
  }
  PetscCall(PetscFree(buffer));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, bad, 1, LATIN_MPI_BOOL, MPI_LOR, tree->comm));
  PetscFunctionReturn(0);
}

/* In x, the forces on all rows: y on the interior ones, on the others what is left of them; or back, from y and u_b there to u */
static PetscErrorCode LatinJointSolve_Private(LatinJoint *joint, PetscBool back)
{
  const PetscScalar  one = 1.0, minus = -1.0;
  const PetscBLASInt inc = 1;
  PetscBLASInt       rows, in, out;

  PetscFunctionBegin;
  PetscCall(PetscBLASIntCast(joint->rows, &rows));
  PetscCall(PetscBLASIntCast(joint->interior, &in));
  out = rows - in;
  if (!in) PetscFunctionReturn(0);
  if (back && out) PetscCallBLAS("BLASgemv", BLASgemv_("T", &out, &in, &minus, joint->L + in, &rows, joint->x + in, &inc, &one, joint->x, &inc));
  PetscCallBLAS("BLAStrsm", BLAStrsm_("L", "L", back ? "T" : "N", "N", &in, &inc, &one, joint->L, &rows, joint->x, &in));
  if (!back && out) PetscCallBLAS("BLASgemv", BLASgemv_("N", &out, &in, &minus, joint->L + in, &rows, joint->x, &inc, &one, joint->x + in, &inc));
  PetscCall(PetscLogFlops((double)in * ((double)in + 2.0 * out)));
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
  PetscCall(LatinJointSolve_Private(joint, PETSC_FALSE));
  PetscCall(PetscArraycpy(w, joint->x + joint->interior, out));
  PetscCall(LatinTreePass_Private(tree, joint->to, out, PETSC_TRUE));
  PetscCall(LatinTreePass_Private(tree, joint->to, out, PETSC_FALSE));
  PetscCall(PetscArraycpy(joint->x + joint->interior, w, out));
  PetscCall(LatinJointSolve_Private(joint, PETSC_TRUE));
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
    PetscCall(PetscFree(tree->joint->L));
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
