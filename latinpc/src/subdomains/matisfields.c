#include "subdomains/latinsubdomains.h"
#include <petscds.h>
#include <petscfe.h>

/*
   largest residual of a vector of the null space, relative to the largest diagonal entry and the vector; rounding leaves 1e-12, a wrong vector 1e-2 and
   more
*/
#define LATIN_KERNEL_LEFT LatinByPrecision(1e-6, 1e-2)

/* Data of the unknowns of a matrix: coordinates, fields, near null space. They improve the macro modes; none is required. */

/* Function for DMProjectFunction(): coordinate *ctx, for all components of a field */
static PetscErrorCode LatinCoordinate_Private(PetscInt dim, PetscReal t, const PetscReal x[], PetscInt n, PetscScalar *out, void *ctx)
{
  for (PetscInt c = 0; c < n; c++) out[c] = x[*(PetscInt *)ctx];
  return 0;
}

/* Function for DMProjectFunction(): the number of each component, from *ctx on */
static PetscErrorCode LatinComponent_Private(PetscInt dim, PetscReal t, const PetscReal x[], PetscInt n, PetscScalar *out, void *ctx)
{
  for (PetscInt c = 0; c < n; c++) out[c] = (PetscScalar)(*(PetscInt *)ctx + c);
  return 0;
}

/* Gets coordinates and fields of finite element unknowns: interpolates x, y, z and component numbers in the element spaces. Collective on dm */
static PetscErrorCode LatinUnknownsElements_Private(DM dm, PetscInt rows, LatinUnknowns *known)
{
  typedef PetscErrorCode (*Function)(PetscInt, PetscReal, const PetscReal[], PetscInt, PetscScalar *, void *);
  PetscInt           nf, nl, *first, fields = 0;
  Function          *functions;
  void             **contexts;
  Vec                v;
  const PetscScalar *a;
  PetscBool          fit;

  PetscFunctionBegin;
  PetscCall(DMGetNumFields(dm, &nf));
  if (!nf) PetscFunctionReturn(0);
  PetscCall(DMCreateGlobalVector(dm, &v));
  PetscCall(VecGetLocalSize(v, &nl));
  fit = (PetscBool)(nl == rows);
  PetscCall(PetscMalloc3(nf, &functions, nf, &contexts, nf, &first));
  for (PetscInt f = 0; f < nf; f++) {
    PetscObject element;
    PetscInt    components = 0;

    PetscCall(DMGetField(dm, f, NULL, &element));
    if (element->classid == PETSCFE_CLASSID) PetscCall(PetscFEGetNumComponents((PetscFE)element, &components));
    else fit = PETSC_FALSE;
    first[f] = fields;
    fields += components;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &fit, 1, LATIN_MPI_BOOL, MPI_LAND, PetscObjectComm((PetscObject)dm)));
  if (fit) {
    known->fields = fields;
    PetscCall(DMGetCoordinateDim(dm, &known->dim));
    PetscCall(PetscMalloc1(known->dim * rows, &known->x));
    PetscCall(PetscMalloc1(rows, &known->field));
  }
  for (PetscInt d = 0; fit && d <= known->dim; d++) {
    for (PetscInt f = 0; f < nf; f++) {
      functions[f] = d < known->dim ? LatinCoordinate_Private : LatinComponent_Private;
      contexts[f]  = d < known->dim ? &d : first + f;
    }
    PetscCall(DMProjectFunction(dm, 0.0, functions, contexts, INSERT_VALUES, v));
    PetscCall(VecGetArrayRead(v, &a));
    for (PetscInt i = 0; i < rows; i++) {
      if (d < known->dim) known->x[known->dim * i + d] = PetscRealPart(a[i]);
      else known->field[i] = PetscMax(0, PetscMin(fields - 1, (PetscInt)(PetscRealPart(a[i]) + 0.5)));
    }
    PetscCall(VecRestoreArrayRead(v, &a));
  }
  PetscCall(PetscFree3(functions, contexts, first));
  PetscCall(VecDestroy(&v));
  PetscFunctionReturn(0);
}

/*
   Gets coordinates from v, a block for each node: given by PCSetCoordinates(); or of a DM, used only if its vectors have a block for each node, as of a
   DMDA. Collective on v
*/
static PetscErrorCode LatinUnknownsNodes_Private(Vec v, PetscInt dim, PetscBool given, PetscInt rows, LatinUnknowns *known)
{
  MPI_Comm           comm = PetscObjectComm((PetscObject)v);
  PetscInt           nodes, each = known->fields, fit;
  const PetscScalar *a;

  PetscFunctionBegin;
  PetscCall(VecGetLocalSize(v, &nodes));
  nodes /= dim;
  if (given) {
    each = nodes ? rows / nodes : 0;
    PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &each, 1, MPIU_INT, MPI_MAX, comm));
  }
  LatinAgree(comm, given && nodes * each != rows, PETSC_ERR_ARG_SIZ,
             "PCSetCoordinates() has given %" PetscInt_FMT " nodes to a rank of %" PetscInt_FMT " unknowns, which are not %" PetscInt_FMT " for each node: give every node of all ranks the same number of unknowns, or each unknown a node", nodes, rows,
             each);
  fit = nodes * each == rows ? 1 : 0;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &fit, 1, MPIU_INT, MPI_MIN, comm));
  if (!fit) PetscFunctionReturn(0);
  if (each > 1) known->fields = each; /* a MATIS has no block size if its local-to-global map has none */
  known->dim = dim;
  PetscCall(PetscFree(known->x));
  PetscCall(PetscMalloc1(dim * rows, &known->x));
  PetscCall(VecGetArrayRead(v, &a));
  for (PetscInt i = 0; i < rows; i++)
    for (PetscInt d = 0; d < dim; d++) known->x[dim * i + d] = PetscRealPart(a[dim * (i / each) + d]);
  PetscCall(VecRestoreArrayRead(v, &a));
  PetscFunctionReturn(0);
}

/* Copies the vectors of a null space to *vectors, column-major, the constant one first */
static PetscErrorCode LatinUnknownsSpace_Private(MatNullSpace space, PetscInt rows, PetscInt *count, PetscReal *vectors[])
{
  PetscBool          constant = PETSC_FALSE;
  PetscInt           n        = 0;
  const Vec         *v        = NULL;
  const PetscScalar *a;

  PetscFunctionBegin;
  if (!space) PetscFunctionReturn(0);
  PetscCall(MatNullSpaceGetVecs(space, &constant, &n, &v));
  PetscCall(PetscMalloc1((n + 1) * rows, vectors));
  *count = 0;
  if (constant) {
    for (PetscInt i = 0; i < rows; i++) (*vectors)[i] = 1.0;
    *count = 1;
  }
  for (PetscInt k = 0; k < n; k++, (*count)++) {
    PetscCall(VecGetArrayRead(v[k], &a));
    for (PetscInt i = 0; i < rows; i++) (*vectors)[rows * *count + i] = PetscRealPart(a[i]);
    PetscCall(VecRestoreArrayRead(v[k], &a));
  }
  PetscFunctionReturn(0);
}

PetscErrorCode LatinUnknownsReset_Private(LatinUnknowns *known)
{
  PetscFunctionBegin;
  PetscCall(PetscFree(known->x));
  PetscCall(PetscFree(known->field));
  PetscCall(PetscFree(known->near));
  PetscCall(PetscFree(known->kernel));
  PetscCall(PetscMemzero(known, sizeof(*known)));
  PetscFunctionReturn(0);
}

/* Returns the number of non-finite numbers */
static PetscInt LatinNotFinite(PetscInt n, const PetscReal x[])
{
  PetscInt count = 0;

  for (PetscInt i = 0; i < n && x; i++) count += PetscIsInfOrNanReal(x[i]) ? 1 : 0;
  return count;
}

/* Fails if a vector of the null space is not in the kernel of A, whose stiffest unknown is the measure. Collective on A */
static PetscErrorCode LatinKernelCheck_Private(Mat A, MatNullSpace kernel)
{
  PetscBool  constant;
  PetscInt   n;
  PetscReal  stiffest, size, left;
  const Vec *given;
  Vec        v, w;

  PetscFunctionBegin;
  if (!kernel) PetscFunctionReturn(0);
  PetscCall(MatNullSpaceGetVecs(kernel, &constant, &n, &given));
  PetscCall(MatCreateVecs(A, &v, &w));
  PetscCall(MatGetDiagonal(A, w));
  PetscCall(VecNorm(w, NORM_INFINITY, &stiffest));
  for (PetscInt k = constant ? -1 : 0; k < n; k++) {
    if (k < 0) PetscCall(VecSet(v, 1.0));
    else PetscCall(VecCopy(given[k], v));
    PetscCall(VecNorm(v, NORM_INFINITY, &size));
    PetscCall(MatMult(A, v, w));
    PetscCall(VecNorm(w, NORM_INFINITY, &left));
    PetscCheck(
      !(left > LATIN_KERNEL_LEFT * stiffest * size), PetscObjectComm((PetscObject)A), PETSC_ERR_ARG_WRONG,
      "%s of the null space of the matrix, MatSetNullSpace(), is not in its kernel: the matrix times it is %.1e of its largest diagonal entry times it. Leave it out, or, if it is to help the coarse problem, give it with MatSetNearNullSpace()",
      k < 0 ? "The constant vector" : "A vector", (double)(left / (stiffest * size)));
  }
  PetscCall(VecDestroy(&v));
  PetscCall(VecDestroy(&w));
  PetscFunctionReturn(0);
}

/*
   Collects the data of the unknowns: coordinates given to the preconditioner (NULL: none), or of the DM; fields of the finite
   elements of the DM, or components of blocks; near null space. Collective on A.
*/
PetscErrorCode LatinUnknownsSetUp_Private(Mat A, DM dm, Vec coordinates, LatinUnknowns *known)
{
  PetscInt     rows, dim = 0;
  MatNullSpace near, kernel;
  PetscBool    plex = PETSC_FALSE;
  Vec          v    = coordinates;

  PetscFunctionBegin;
  PetscCall(LatinUnknownsReset_Private(known));
  PetscCall(MatGetLocalSize(A, &rows, NULL));
  PetscCall(MatGetBlockSize(A, &known->fields));
  if (dm) PetscCall(PetscObjectTypeCompare((PetscObject)dm, DMPLEX, &plex));
  if (plex) PetscCall(LatinUnknownsElements_Private(dm, rows, known));
  if (coordinates) PetscCall(VecGetBlockSize(coordinates, &dim));
  else if (dm && !plex) {
    PetscCall(DMGetCoordinates(dm, &v));
    PetscCall(DMGetCoordinateDim(dm, &dim));
  }
  if (v && dim >= 1 && dim <= 3) PetscCall(LatinUnknownsNodes_Private(v, dim, (PetscBool)(coordinates != NULL), rows, known));
  if (!known->field) {
    PetscCall(PetscMalloc1(rows, &known->field));
    for (PetscInt i = 0; i < rows; i++) known->field[i] = i % known->fields; /* blocks are not split between ranks */
  }
  PetscCall(MatGetNullSpace(A, &kernel));
  PetscCall(LatinUnknownsSpace_Private(kernel, rows, &known->kernels, &known->kernel));
  PetscCall(MatGetNearNullSpace(A, &near));
  PetscCall(LatinUnknownsSpace_Private(near ? near : kernel, rows, &known->nears, &known->near));
  LatinAgree(PetscObjectComm((PetscObject)A), LatinNotFinite(known->dim * rows, known->x) > 0, PETSC_ERR_FP, "The unknowns of the matrix have coordinates that are not finite numbers (PCSetCoordinates(), or the DM)");
  LatinAgree(PetscObjectComm((PetscObject)A), LatinNotFinite(known->nears * rows, known->near) || LatinNotFinite(known->kernels * rows, known->kernel), PETSC_ERR_FP,
             "A vector of the near null space, or of the null space, of the matrix has numbers that are not finite");
  PetscCall(LatinKernelCheck_Private(A, kernel));
  PetscFunctionReturn(0);
}
