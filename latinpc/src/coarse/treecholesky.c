#include "base/room.h"
#include "coarse/tree.h"
#include <petsc/private/matimpl.h>

/*
   Elimination along the tree of treeplan.c. A rank eliminates what it alone has of its part; what is left, a dense matrix of the
   unknowns that it shares, joins that of its partner, and what the two alone have is eliminated; and so on. With i these unknowns,
   b the others:

     K_ii = L L^t,   Z = K_bi L^-t,   S = K_bb - Z Z^t, the contribution block, which joins the next one;
     forward: y = L^-1 g_i,   g_b - Z y is sent;   backward: u_b comes back,   u_i = L^-t (y - Z^t u_b).

   So a solve takes one message each way for each of the groups that join, and a rank keeps no more than the columns of one joint.

   S never is there as a whole. All lists have their unknowns in the order in which joints eliminate them, so that columns come from
   both groups in the order of the front that they add to. A panel of columns is complete once these have come, and what earlier
   panels leave on it has been taken from it: those of the interior are then eliminated, and stay; the others go on, one by one.

   No rank waits for ever. What parts leave goes by messages that nobody waits for before the joints are done. So the joint at the
   top that still waits does so for a group that it has taken all messages from which that group has sent: the joint of that
   group does not wait to send, but for one of its own groups; and so on down to a part, which has sent everything, or still computes.
*/

/*
   What is left of a part, symmetric: its lower triangle, in the order of its rows in the joints, see LatinLowerAt(). 64 columns are a
   message: large enough to be all bandwidth, small beside a front
*/
typedef struct {
  PetscInt     n;
  PetscScalar *a;
  PetscScalar *own;  /* to be freed: a */
  Mat          part; /* or this, to be destroyed */
  PetscInt     messages;
  MPI_Request *sent; /* [messages] */
  PetscMPIInt *gone; /* [messages] work */
} LatinLeft;

/* Nobody reads the columns of this message any more */
static void LatinLeftEmpty(const LatinLeft *left, PetscInt message)
{
  const size_t start = LatinPanelSize(1, left->n, LATIN_FRONT_PANEL * message), end = LatinPanelSize(1, left->n, PetscMin(LATIN_FRONT_PANEL * (message + 1), left->n));

  LatinRoomEmpty(left->a + start, (end - start) * sizeof(*left->a));
}

/* All of it starts on its way to another rank */
static PetscErrorCode LatinLeftSend_Private(const LatinTree *tree, LatinLeft *left)
{
  PetscFunctionBegin;
  left->messages = (left->n + LATIN_FRONT_PANEL - 1) / LATIN_FRONT_PANEL;
  PetscCall(PetscMalloc2(left->messages, &left->sent, left->messages, &left->gone));
  for (PetscInt m = 0; m < left->messages; m++) {
    const size_t start = LatinPanelSize(1, left->n, LATIN_FRONT_PANEL * m), end = LatinPanelSize(1, left->n, PetscMin(LATIN_FRONT_PANEL * (m + 1), left->n));
    PetscMPIInt  length;

    PetscCall(PetscMPIIntCast((PetscInt)(end - start), &length));
    PetscCallMPI(MPI_Isend(left->a + start, length, MPIU_SCALAR, tree->to, 0, tree->comm, &left->sent[m]));
  }
  PetscFunctionReturn(0);
}

/* What has arrived there goes here */
static PetscErrorCode LatinLeftGone_Private(LatinLeft *left)
{
  PetscMPIInt count = 0;

  PetscFunctionBegin;
  if (left->messages) PetscCallMPI(MPI_Testsome((PetscMPIInt)left->messages, left->sent, &count, left->gone, MPI_STATUSES_IGNORE));
  for (PetscMPIInt k = 0; k < count; k++) LatinLeftEmpty(left, left->gone[k]); /* MPI_UNDEFINED, which is negative: nothing is under way */
  PetscFunctionReturn(0);
}

/* Once all of it has gone */
static PetscErrorCode LatinLeftFree_Private(LatinLeft *left)
{
  PetscFunctionBegin;
  if (left->messages) PetscCallMPI(MPI_Waitall((PetscMPIInt)left->messages, left->sent, MPI_STATUSES_IGNORE));
  PetscCall(PetscFree2(left->sent, left->gone));
  PetscCall(PetscFree(left->own));
  PetscCall(MatDestroy(&left->part));
  PetscFunctionReturn(0);
}

/* The columns that a group brings to a joint */
typedef struct {
  PetscMPIInt        rank;
  PetscInt           n, next; /* the next one, */
  const PetscInt    *at;      /* [n] their rows in the front */
  const PetscScalar *column;  /* from its diagonal on */
  PetscScalar       *buffer;  /* room for a message; NULL: they are here */
} LatinComing;

static PetscErrorCode LatinComingCreate_Private(const LatinTree *tree, PetscInt k, LatinComing *coming)
{
  const LatinJoint *joint = tree->joint;

  PetscFunctionBegin;
  *coming = (LatinComing){.rank = joint->from[k], .n = joint->n[k], .at = joint->at + (k ? joint->n[0] : 0)};
  if (coming->rank != tree->rank) PetscCall(PetscMalloc1(LATIN_FRONT_PANEL * coming->n, &coming->buffer));
  PetscFunctionReturn(0);
}

/* Those that come before column `last` of the front join its panel, which begins with column c */
static PetscErrorCode LatinComingAdd_Private(const LatinTree *tree, const LatinLeft *left, PetscInt c, PetscInt last, LatinComing *coming, PetscScalar panel[])
{
  const PetscInt n = coming->n, *at = coming->at;
  PetscMPIInt    length;

  PetscFunctionBegin;
  PetscCall(PetscMPIIntCast(LATIN_FRONT_PANEL * n, &length));
  for (; coming->next < n && at[coming->next] < last; coming->next++) {
    const PetscInt j  = coming->next;
    PetscScalar   *to = panel + (size_t)(tree->joint->rows - c) * (size_t)(at[j] - c) - c;

    if (j % LATIN_FRONT_PANEL == 0) {
      if (!coming->buffer && j) LatinLeftEmpty(left, j / LATIN_FRONT_PANEL - 1);
      if (coming->buffer) PetscCallMPI(MPI_Recv(coming->buffer, length, MPIU_SCALAR, coming->rank, 0, tree->comm, MPI_STATUS_IGNORE));
      coming->column = coming->buffer ? coming->buffer : left->a + LatinPanelSize(1, n, j);
    }
    for (PetscInt i = j; i < n; i++) to[at[i]] += coming->column[i - j];
    coming->column += n - j;
  }
  PetscFunctionReturn(0);
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

/* Eliminates so many interior columns of a front from c on, whose panel is complete; *bad: it is not positive definite */
static PetscErrorCode LatinJointEliminate_Private(const LatinJoint *joint, PetscInt c, PetscInt some, PetscScalar panel[], PetscBool *bad)
{
  const PetscScalar  one  = 1.0;
  const PetscBLASInt wide = (PetscBLASInt)some, height = (PetscBLASInt)(joint->rows - c), below = height - wide;
  PetscBLASInt       info = 0;

  PetscFunctionBegin;
  PetscCallBLAS("LAPACKpotrf", LAPACKpotrf_("L", &wide, panel, &height, &info));
  if (info) *bad = PETSC_TRUE;
  if (info) PetscFunctionReturn(0);
  if (below) PetscCallBLAS("BLAStrsm", BLAStrsm_("R", "L", "T", "N", &below, &wide, &one, panel, &height, panel + wide, &height));
  for (PetscInt k = 1; k < some; k++) PetscCall(PetscArrayzero(panel + (size_t)height * (size_t)k, k));
  PetscFunctionReturn(0);
}

/* So many columns of what is left from c on go to the next joint, each from its diagonal on */
static PetscErrorCode LatinJointSend_Private(const LatinTree *tree, PetscInt c, PetscInt some, PetscScalar panel[])
{
  const PetscInt height = tree->joint->rows - c;
  PetscInt       n      = 0;
  PetscMPIInt    length;

  PetscFunctionBegin;
  for (PetscInt k = 0; k < some; n += height - k++) PetscCall(PetscArraymove(panel + n, panel + (size_t)(height + 1) * (size_t)k, height - k));
  PetscCall(PetscMPIIntCast(n, &length));
  PetscCallMPI(MPI_Send(panel, length, MPIU_SCALAR, tree->joint->to, 0, tree->comm));
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

/* Row at[r] of a lower triangle becomes row r, and columns as well: in place, for it may be as large as the factor */
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
  *left = (LatinLeft){.n = tree->rest};
  PetscCall(PetscMalloc1(tree->rest, &at));
  PetscCall(PetscArraycpy(at, tree->row, tree->rest));
  if (tree->rest < tree->n) PetscCall(LatinTreeSparse_Private(tree, K, left, at, bad));
  else PetscCall(LatinTreeDense_Private(tree, K, left));
  PetscCall(LatinLeftOrder_Private(tree->rest, at, left->a));
  PetscCall(PetscFree(at));
  PetscFunctionReturn(0);
}

/*
   The front of the joint, panel by panel from what comes and what is left here: those of the interior are eliminated, the others go on.
   Where it is not positive definite they go all the same, for the next joint waits
*/
static PetscErrorCode LatinTreeJoin_Private(LatinTree *tree, PetscBool rounded, LatinLeft *left, PetscBool *bad)
{
  LatinJoint    *joint = tree->joint;
  const PetscInt rows = joint->rows, in = joint->interior;
  PetscScalar   *L, *S;
  LatinComing    coming[2];

  PetscFunctionBegin;
  PetscCall(LatinJointFront_Private(joint));
  PetscCall(LatinRoomDestroy_Private(&joint->front.factor));
  PetscCall(PetscMalloc1(joint->front.panel[1], &L));
  PetscCall(PetscMalloc1(LATIN_FRONT_PANEL * (rows - in), &S));
  for (PetscInt k = 0; k < 2; k++) PetscCall(LatinComingCreate_Private(tree, k, &coming[k]));
  for (PetscInt c = 0, wide; c < rows; c += wide) {
    const PetscBool inside = (PetscBool)(c < in);
    PetscScalar    *panel  = inside ? L + LatinPanelAt(LATIN_FRONT_PANEL, rows, c) : S;

    wide = PetscMin(LATIN_FRONT_PANEL, (inside ? in : rows) - c);
    PetscCall(PetscArrayzero(panel, (size_t)(rows - c) * (size_t)wide));
    for (PetscInt k = 0; k < 2; k++) PetscCall(LatinComingAdd_Private(tree, left, c, c + wide, &coming[k], panel));
    if (!*bad) PetscCall(LatinJointTake_Private(joint, L, c, wide, panel));
    if (inside && !*bad) PetscCall(LatinJointEliminate_Private(joint, c, wide, panel, bad));
    if (!inside) PetscCall(LatinJointSend_Private(tree, c, wide, panel));
    PetscCall(LatinLeftGone_Private(left));
  }
  for (PetscInt k = 0; k < 2; k++) PetscCall(PetscFree(coming[k].buffer));
  PetscCall(PetscFree(S));
  PetscCall(PetscLogFlops((double)in * ((double)in * in / 3.0 + (double)in * (rows - in) + PetscSqr((double)(rows - in)))));
  PetscCall(LatinJointKeep_Private(joint, rounded, L));
  PetscCall(PetscFree(L));
  PetscFunctionReturn(0);
}

/* The factor of the sum of the parts K, which it takes over, its fronts rounded to single precision or not; on all ranks *bad or on none. Collective on tree->comm */
PetscErrorCode LatinTreeFactor_Private(LatinTree *tree, PetscBool rounded, Mat K, PetscBool *bad)
{
  LatinLeft left;

  PetscFunctionBegin;
  *bad = PETSC_FALSE;
  PetscCall(LatinTreePart_Private(tree, K, &left, bad));
  if (tree->to != tree->rank) PetscCall(LatinLeftSend_Private(tree, &left));
  if (tree->joint) PetscCall(LatinTreeJoin_Private(tree, rounded, &left, bad));
  PetscCall(LatinLeftFree_Private(&left));
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
