#include "error/latinerror.h"

/*
   A part of a structure: the nodes that displacements move farthest. What is loose moves away while the rest comes to its
   place, and it is mostly much smaller than the structure: factors of its own operator cost a fraction.
*/

#define LATIN_PART_HALVINGS 60 /* of the logarithm of a displacement, from the largest to rounding of it: to one of two nodes */

/* How far the nodes of this rank move, [nodes_local], and the largest of all. Collective on structure */
static PetscErrorCode LatinPartMoves_Private(LatinStructure structure, Vec u, PetscReal size[], PetscReal *most)
{
  const PetscInt dim = structure->dim;
  PetscReal     *move;

  PetscFunctionBegin;
  *most = 0.0;
  PetscCall(PetscMalloc1(dim * structure->nodes_local, &move));
  PetscCall(LatinStructureGetDisplacements(structure, u, move));
  for (PetscInt i = 0; i < structure->nodes_local; i++) {
    size[i] = 0.0;
    for (PetscInt c = 0; c < dim; c++) size[i] += structure->fixed[dim * i + c] ? 0.0 : PetscSqr(move[dim * i + c]);
    size[i] = PetscSqrtReal(size[i]);
    *most   = PetscMax(*most, size[i]);
  }
  PetscCall(PetscFree(move));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, most, 1, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)structure)));
  PetscFunctionReturn(0);
}

/* Rows of the matrix for the free displacements of the nodes that move farthest, `most` at most; how many rows here. Collective on structure */
static PetscErrorCode LatinPartNumber_Private(LatinStructure structure, Vec u, PetscInt most, LatinPart *part, PetscInt row[], PetscInt *rows)
{
  const PetscInt dim  = structure->dim;
  const MPI_Comm comm = PetscObjectComm((PetscObject)structure);
  PetscReal     *size, low, high, least;
  PetscInt       start = 0;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(structure->nodes_local, &size));
  PetscCall(LatinPartMoves_Private(structure, u, size, &high));
  low = PETSC_MACHINE_EPSILON * high;
  for (PetscInt k = 0; k < LATIN_PART_HALVINGS && low < high; k++) {
    PetscInt count = 0;

    least = PetscSqrtReal(low) * PetscSqrtReal(high);
    for (PetscInt i = 0; i < structure->nodes_local; i++) count += size[i] > least ? 1 : 0;
    PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &count, 1, MPIU_INT, MPI_SUM, comm));
    if (count > most) low = least;
    else high = least;
  }
  *rows = part->nodes = 0;
  for (PetscInt i = 0; i < structure->nodes_local; i++) {
    if (size[i] > high) part->nodes++;
    for (PetscInt c = dim * i; c < dim * (i + 1); c++) row[c] = size[i] > high && !structure->fixed[c] ? (*rows)++ : -1;
  }
  PetscCallMPI(MPI_Exscan(rows, &start, 1, MPIU_INT, MPI_SUM, comm));
  for (PetscInt c = 0; c < dim * structure->nodes_local; c++) row[c] += row[c] >= 0 ? start : 0;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &part->nodes, 1, MPIU_INT, MPI_SUM, comm));
  PetscCall(PetscFree(size));
  PetscFunctionReturn(0);
}

/* The matrix, with room for its entries. Collective on structure */
static PetscErrorCode LatinPartMatrix_Private(LatinStructure structure, const PetscInt row[], PetscInt rows, LatinPart *part)
{
  const PetscInt dim = structure->dim;
  PetscInt      *vertex, *links, *room, *beside, all, at = 0; /* links at vertices and nodes, entries of rows with columns of this rank and of others */

  PetscFunctionBegin;
  PetscCall(PetscCalloc4(structure->vertices, &vertex, structure->nodes_local, &links, rows, &room, rows, &beside));
  for (PetscInt i = 0; i < 2 * structure->links_local; i++) vertex[structure->ends[i]]++;
  PetscCall(LatinSFReduce_Private(structure->vertex_sf, 1, MPIU_INT, vertex, links, MPI_SUM));
  PetscCall(MPIU_Allreduce(&rows, &all, 1, MPIU_INT, MPI_SUM, PetscObjectComm((PetscObject)structure)));
  for (PetscInt c = 0; c < dim * structure->nodes_local; c++) {
    if (row[c] < 0) continue;
    room[at]     = PetscMin(rows, dim * (1 + links[c / dim]));
    beside[at++] = PetscMin(all - rows, dim * links[c / dim]);
  }
  PetscCall(MatCreate(PetscObjectComm((PetscObject)structure), &part->A));
  PetscCall(MatSetSizes(part->A, rows, rows, all, all));
  PetscCall(MatSetType(part->A, MATAIJ));
  PetscCall(MatSeqAIJSetPreallocation(part->A, 0, room));
  PetscCall(MatMPIAIJSetPreallocation(part->A, 0, room, 0, beside));
  PetscCall(MatSetOption(part->A, MAT_SPD, PETSC_TRUE));
  PetscCall(MatCreateVecs(part->A, &part->x, &part->b));
  PetscCall(PetscFree4(vertex, links, room, beside));
  PetscFunctionReturn(0);
}

/* From the free displacements of the structure to those of the part. Collective on structure */
static PetscErrorCode LatinPartScatter_Private(LatinStructure structure, const PetscInt row[], PetscInt rows, LatinPart *part)
{
  PetscInt *from, at = 0;
  IS        is;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(rows, &from));
  for (PetscInt c = 0; c < structure->dim * structure->nodes_local; c++)
    if (row[c] >= 0) from[at++] = structure->global_dof[c];
  PetscCall(ISCreateGeneral(PetscObjectComm((PetscObject)structure), rows, from, PETSC_OWN_POINTER, &is));
  PetscCall(VecScatterCreate(structure->load, is, part->b, NULL, &part->out));
  PetscCall(ISDestroy(&is));
  PetscFunctionReturn(0);
}

/* The part of the nodes, `most` at most, that the displacements u move farthest; its linear solves go to rtol. part->nodes is 0 where there are none. Collective on structure */
PetscErrorCode LatinPartCreate_Private(LatinStructure structure, Vec u, PetscInt most, PetscReal rtol, LatinPart *part)
{
  const MPI_Comm comm = PetscObjectComm((PetscObject)structure);
  PetscInt      *row, rows;
  PetscMPIInt    size;
  PC             pc;

  PetscFunctionBegin;
  PetscCall(PetscMemzero(part, sizeof(*part)));
  PetscCall(PetscMalloc1(structure->dim * structure->nodes_local, &row));
  PetscCall(PetscMalloc1(structure->dim * structure->vertices, &part->number));
  PetscCall(LatinPartNumber_Private(structure, u, most, part, row, &rows));
  PetscCall(LatinSFBcast_Private(structure->vertex_sf, structure->dim, MPIU_INT, row, part->number));
  PetscCall(LatinPartMatrix_Private(structure, row, rows, part));
  PetscCall(LatinPartScatter_Private(structure, row, rows, part));
  PetscCall(PetscFree(row));
  PetscCallMPI(MPI_Comm_size(comm, &size));
  PetscCall(KSPCreate(comm, &part->ksp));
  PetscCall(KSPSetOptionsPrefix(part->ksp, "latin_part_")); /* options without prefix are for others */
  PetscCall(KSPSetType(part->ksp, KSPCG));
  PetscCall(KSPSetTolerances(part->ksp, rtol, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscCall(KSPGetPC(part->ksp, &pc));
  if (part->nodes) PetscCall(LatinDirectSolver_Private(pc, part->A, size > 1 ? MATSOLVERMUMPS : LATIN_CHOLESKY));
  PetscFunctionReturn(0);
}

/* Its operator B^t k B, for stiffnesses k of all links of this rank. Collective on structure */
PetscErrorCode LatinPartOperator_Private(LatinStructure structure, LatinPart *part, const PetscReal k[])
{
  const PetscInt dim = structure->dim;

  PetscFunctionBegin;
  PetscCall(MatZeroEntries(part->A));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscReal *n = structure->direction + dim * l;
    PetscScalar      a[36];
    PetscInt         row[6];

    if (!LatinPartHas(structure, part, l)) continue;
    for (PetscInt i = 0; i < 2 * dim; i++) {
      row[i] = part->number[dim * structure->ends[2 * l + i / dim] + i % dim];
      for (PetscInt j = 0; j < 2 * dim; j++) a[2 * dim * i + j] = (i / dim == j / dim ? k[l] : -k[l]) * n[i % dim] * n[j % dim];
    }
    PetscCall(MatSetValues(part->A, 2 * dim, row, 2 * dim, row, a, ADD_VALUES)); /* negative rows are left out */
  }
  PetscCall(MatAssemblyBegin(part->A, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(part->A, MAT_FINAL_ASSEMBLY));
  PetscCall(KSPSetOperators(part->ksp, part->A, part->A));
  PetscFunctionReturn(0);
}

/* x = the displacements of the part under its forces of b, and zero elsewhere. Collective on the structure */
PetscErrorCode LatinPartSolve_Private(LatinPart *part, Vec b, Vec x)
{
  PetscFunctionBegin;
  PetscCall(VecScatterBegin(part->out, b, part->b, INSERT_VALUES, SCATTER_FORWARD));
  PetscCall(VecScatterEnd(part->out, b, part->b, INSERT_VALUES, SCATTER_FORWARD));
  PetscCall(KSPSolve(part->ksp, part->b, part->x));
  PetscCall(VecZeroEntries(x));
  PetscCall(VecScatterBegin(part->out, part->x, x, INSERT_VALUES, SCATTER_REVERSE));
  PetscCall(VecScatterEnd(part->out, part->x, x, INSERT_VALUES, SCATTER_REVERSE));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinPartDestroy_Private(LatinPart *part)
{
  PetscFunctionBegin;
  PetscCall(PetscFree(part->number));
  PetscCall(VecScatterDestroy(&part->out));
  PetscCall(VecDestroy(&part->b));
  PetscCall(VecDestroy(&part->x));
  PetscCall(MatDestroy(&part->A));
  PetscCall(KSPDestroy(&part->ksp));
  PetscFunctionReturn(0);
}
