#include "core/latinimpl.h"

/*
   Diagnosis of a failed factorisation: the structure has a mechanism, a displacement that changes the length of no link, or its prestress makes it
   buckle. The matrix of a subdomain has springs on its interfaces and clamped primal dofs: it is singular only if the mechanism is inside that
   subdomain. The coarse matrix is singular if a mechanism reaches the interfaces.

   1. The eigenvector of the failed matrix, found by its factorisation, is expanded to displacements of the copies of nodes.
   2. Of a structure: whether prestress would hold the mechanism, or makes the structure buckle.
   3. The error names nodes that move, and a cure.
*/

#define LATIN_MOVED_MOST  64   /* most nodes of a rank that are collected for a message */
#define LATIN_MOVED_NAMED 8    /* most nodes in a message */
#define LATIN_MOVED_PART  0.5  /* least displacement of a node in a message, relative to the largest */
#define LATIN_DOUBT       1e-3 /* largest rounding of the largest stiffness, relative to the least one, at which this is not lost */

/* Creates newfield, [copies][bs] displacements of the eigenvector v of the matrix of a batch, or of the coarse matrix (batch NULL). The caller frees it */
static PetscErrorCode LatinMechanismField_Private(Latin latin, Vec v, const LatinBatch *batch, PetscReal *newfield[])
{
  const LatinSubdomains *sub = &latin->sub;
  const PetscInt         bs  = sub->bs;
  const PetscScalar     *a;
  PetscReal             *field;

  PetscFunctionBegin;
  PetscCall(PetscCalloc1(bs * sub->copies, newfield));
  field = *newfield;
  if (batch) {
    PetscCall(VecGetArrayRead(v, &a));
    PetscCall(PetscArraycpy(field + bs * sub->node_offset[batch->sub[0]], a, batch->rows));
    PetscCall(VecRestoreArrayRead(v, &a));
  } else {
    PetscCall(LatinCoarseExpand_Private(&latin->coarse, v));
    PetscCall(PetscArrayzero(latin->linear.g, bs * sub->copies));
    PetscCall(PetscArrayzero(latin->coarse.q, latin->coarse.offset[sub->n]));
    PetscCall(LatinLinearExpand(&latin->linear, field));
  }
  for (PetscInt i = 0; i < bs * sub->copies; i++)
    if (sub->fixed[i]) field[i] = 0.0; /* their rows are those of the identity */
  PetscFunctionReturn(0);
}

/*
   Finds whether the geometric stiffness of the prestress would hold the mechanism. field: NULL on ranks without; largest: its largest displacement on
   all ranks, 0 if there is no field: then *held if the prestress is tensile in the mean, a hint only. *hangs: cables turn in the mechanism, which loads
   may hold. Collective on latin
*/
static PetscErrorCode LatinMechanismHeld_Private(Latin latin, const PetscReal field[], PetscReal largest, PetscBool *held, PetscBool *hangs)
{
  const LatinSubdomains *sub     = &latin->sub;
  const PetscInt         dim     = sub->dim;
  const PetscBool        found   = (PetscBool)(largest > 0.0);
  PetscReal              work[3] = {0.0, 0.0, 0.0}; /* quadratic form of the geometric stiffness, or the sum of tension / length; its rounding; turning of cables */

  PetscFunctionBegin;
  for (PetscInt l = 0; l < sub->links; l++) {
    const PetscBool cable   = (PetscBool)(sub->law[l] == LATIN_LAW_CABLE || sub->law[l] == LATIN_LAW_INEXTENSIBLE);
    const LatinLaw *law     = &LatinLaws[sub->law[l]];
    const PetscReal tension = law->rigid ? 0.0 : law->tension(sub->stiffness[l], sub->e0[l], law->ctx);
    PetscReal       length = 0.0, e = found && field ? LatinElongation(sub, dim, l, field) : 0.0, across = found ? -e * e : 1.0;

    for (PetscInt c = 0; c < dim; c++) {
      const PetscInt a = dim * sub->ends[2 * l] + c, b = dim * sub->ends[2 * l + 1] + c;

      length += PetscSqr(sub->x[b] - sub->x[a]);
      if (found && field) across += PetscSqr(field[b] - field[a]);
    }
    if (!(length > 0.0)) continue;
    if (cable && found) work[2] += across;
    work[0] += tension / PetscSqrtReal(length) * across;
    /* links that do not move turn by the rounding of the field */
    work[1] += PETSC_SQRT_MACHINE_EPSILON * PetscAbsReal(tension) / PetscSqrtReal(length) * (found ? PetscSqr(largest) : 0.0);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, work, 3, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)latin)));
  *held  = (PetscBool)(work[0] > work[1]);
  *hangs = (PetscBool)(work[2] > PETSC_SQRT_MACHINE_EPSILON * PetscSqr(largest));
  PetscFunctionReturn(0);
}

/*
   Finds, in a frame (structure/frame.c), whether the structure buckles: parts of negative stiffness take part in the field, whose energy is not zero, as
   that of a mechanism is. field: NULL on ranks without; largest: its largest displacement on all ranks. Collective on latin
*/
static PetscErrorCode LatinMechanismDriven_Private(Latin latin, const PetscReal field[], PetscReal largest, PetscBool *driven)
{
  const LatinSubdomains *sub     = &latin->sub;
  PetscReal              work[4] = {0.0, 0.0, 0.0, 0.0}; /* energy of all parts; of those of negative stiffness, as a positive number; rounding of both */

  PetscFunctionBegin;
  for (PetscInt l = 0; l < sub->links && field; l++) {
    const PetscReal e = LatinElongation(sub, sub->dim, l, field), k = sub->stiffness[l];

    work[0] += k * e * e;
    work[1] += PetscMax(0.0, -k) * e * e;
    work[2] += PETSC_SQRT_MACHINE_EPSILON * PetscAbsReal(k) * PetscSqr(largest);
    work[3] += PETSC_SQRT_MACHINE_EPSILON * PetscMax(0.0, -k) * PetscSqr(largest);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, work, 4, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)latin)));
  *driven = (PetscBool)(work[1] > work[3] && (work[0] < 0.0 || work[0] > work[2]));
  PetscFunctionReturn(0);
}

/*
   Finds the axis along which all nodes of a mechanism move, across the plane in which a structure in space lies; -1: there is none. field: NULL on ranks
   without; largest: its largest displacement on all ranks. Collective on latin
*/
static PetscErrorCode LatinMechanismAcross_Private(Latin latin, const PetscReal field[], PetscReal largest, PetscInt *axis)
{
  const LatinSubdomains *sub = &latin->sub;
  PetscReal              most[3][3]; /* of each axis: largest displacement, coordinate, negative coordinate */

  PetscFunctionBegin;
  *axis = -1;
  if (sub->dim != 3) PetscFunctionReturn(0);
  for (PetscInt c = 0; c < 3; c++) {
    most[c][0] = 0.0;
    most[c][1] = most[c][2] = -PETSC_MAX_REAL;
    for (PetscInt i = c; i < 3 * sub->copies; i += 3) {
      if (field && !sub->fixed[i]) most[c][0] = PetscMax(most[c][0], PetscAbsReal(field[i]));
      most[c][1] = PetscMax(most[c][1], sub->x[i]);
      most[c][2] = PetscMax(most[c][2], -sub->x[i]);
    }
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, most, 9, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)latin)));
  for (PetscInt c = 0; c < 3; c++)
    if (most[c][0] > 0.0 && most[c][1] + most[c][2] == 0.0 && PetscMax(most[(c + 1) % 3][0], most[(c + 2) % 3][0]) <= PETSC_SQRT_MACHINE_EPSILON * largest) *axis = c;
  PetscFunctionReturn(0);
}

/* Nodes that a mechanism moves most, as text */
typedef struct {
  PetscInt  count;      /* number of those found on this rank */
  char      names[256]; /* the first of them */
  PetscReal largest;    /* largest displacement on all ranks; 0: no rank has a field */
} LatinMoved;

/* Finds the nodes that the mechanism moves most. field: NULL on ranks without. Collective on latin */
static PetscErrorCode LatinMechanismNodes_Private(Latin latin, const PetscReal field[], LatinMoved *moved)
{
  const LatinSubdomains *sub = &latin->sub;
  PetscReal             *size;
  PetscInt               list[LATIN_MOVED_MOST];
  size_t                 used = 0;

  PetscFunctionBegin;
  *moved = (LatinMoved){.count = 0};
  PetscCall(PetscCalloc1(sub->copies, &size));
  for (PetscInt i = 0; field && i < sub->bs * sub->copies; i++)
    if (!sub->fixed[i] && !PetscIsInfOrNanReal(field[i])) size[i / sub->bs] = PetscMax(size[i / sub->bs], PetscAbsReal(field[i]));
  for (PetscInt i = 0; i < sub->copies; i++) moved->largest = PetscMax(moved->largest, size[i]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &moved->largest, 1, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)latin)));
  for (PetscInt i = 0; i < sub->copies && moved->count < LATIN_MOVED_MOST; i++)
    if (size[i] >= LATIN_MOVED_PART * moved->largest && size[i] > 0.0) list[moved->count++] = sub->node[i];
  PetscCall(PetscFree(size));
  PetscCall(PetscSortRemoveDupsInt(&moved->count, list));
  for (PetscInt i = 0; i < PetscMin(moved->count, LATIN_MOVED_NAMED); i++) {
    PetscCall(PetscSNPrintf(moved->names + used, sizeof(moved->names) - used, "%s%" PetscInt_FMT, i ? ", " : "", list[i]));
    PetscCall(PetscStrlen(moved->names, &used));
  }
  PetscFunctionReturn(0);
}

/* Raises the error, with some of the nodes that the mechanism moves most. field: NULL on ranks without. Collective on latin */
static PetscErrorCode LatinMechanismReport_Private(Latin latin, const PetscReal field[])
{
  const LatinStructure structure = latin->sub.structure; /* NULL: of a matrix */
  const char          *what, *cure, *where = ". Nodes that move (counted from 0): ";
  char                 doubt[256] = "", across[128] = "";
  PetscInt             axis  = -1;
  PetscReal            least = 1.0, most = 1.0;
  PetscBool            held = PETSC_FALSE, hangs = PETSC_FALSE, buckles = PETSC_FALSE;
  LatinMoved           moved;

  PetscFunctionBegin;
  PetscCall(LatinMechanismNodes_Private(latin, field, &moved));
  if (structure && !structure->original) PetscCall(LatinMechanismHeld_Private(latin, field, moved.largest, &held, &hangs));
  if (structure) PetscCall(LatinMechanismAcross_Private(latin, field, moved.largest, &axis));
  if (structure && structure->original) PetscCall(LatinMechanismDriven_Private(latin, field, moved.largest, &buckles));
  if (structure) PetscCall(LatinStructureStiffnessRange_Private(structure, &least, &most));
  if (!structure) {
    what  = "The matrix is singular, or not positive definite, or that of a subdomain has negative eigenvalues, as after MatShift()";
    where = ". Unknowns of the field that shows it: ";
    cure  = "Prescribe more unknowns, or give the kernel with MatSetNullSpace()";
  } else if (buckles) {
    what = "The structure as drawn is unstable: its prestress makes it buckle";
    cure = "Change the prestress, prescribe more displacements, or add links";
  } else {
    what = "The structure has a mechanism: it can move without any link changing its length";
    if (axis >= 0) PetscCall(PetscSNPrintf(across, sizeof(across), "It lies in a plane of constant %c: prescribe displacements along %c, or add links", "xyz"[axis], "xyz"[axis]));
    cure = held                                    ? "If its prestress is to hold it, take the geometry prestress or large (-snes_latin_geometry); else prescribe more displacements, or add links"
           : hangs                                 ? "If its cables hang and the loads are to hold it, take the geometry large (-snes_latin_geometry); else prescribe more displacements, or add links"
           : axis >= 0                             ? across
           : structure->mass && !structure->ground ? "If its masses are to move, make time steps (-ts_type latin, on the command line --num-steps); else prescribe more displacements or add links"
                                                   : "Prescribe more displacements or add links";
    /* soft links may be lost in the rounding of stiff ones */
    if (LATIN_MECHANISM * most > LATIN_DOUBT * least)
      PetscCall(PetscSNPrintf(doubt, sizeof(doubt), ", or links too soft to survive rounding: stiffnesses differ by a factor of %.0e (from %g to %g)", (double)(most / least), (double)least, (double)most));
  }
  /* without a field on any rank, all ranks raise the same error, without names */
  LatinAgree(PetscObjectComm((PetscObject)latin), moved.count || moved.largest == 0.0, PETSC_ERR_MAT_CH_ZRPVT, "%s%s%s%s%s. %s", what, doubt, moved.count ? where : "", moved.names, moved.count > LATIN_MOVED_NAMED ? " and others" : "", cure);
  PetscFunctionReturn(0);
}

/*
   Raises the same error on all ranks if a factorisation has failed on any of them, with nodes of the mechanism, if any. batch: that of the failed
   matrix, NULL: the coarse one; name: of the solver. Destroys status->mode. Collective on latin
*/
PetscErrorCode LatinFactorAgree_Private(Latin latin, LatinFactorStatus *status, const LatinBatch *batch, const char name[])
{
  MPI_Comm       comm  = PetscObjectComm((PetscObject)latin);
  PetscReal     *field = NULL;
  PetscErrorCode ierr;
  PetscMPIInt    mine = status->mechanism ? 1 : 0, any;

  PetscFunctionBegin;
  LatinAgree(comm, (status->ierr || status->failed) && !status->mechanism, status->ierr ? status->ierr : PETSC_ERR_LIB, "Setting up the %s solver failed (PETSc error %d, PC failure %d); its options start with -%s%s_", name, (int)status->ierr,
             (int)status->failed, LatinPrefix(&latin->sub), name);
  PetscCallMPI(MPI_Allreduce(&mine, &any, 1, MPI_INT, MPI_MAX, comm));
  if (!any) PetscFunctionReturn(0);
  if (status->mode) PetscCall(LatinMechanismField_Private(latin, status->mode, batch, &field));
  ierr = LatinMechanismReport_Private(latin, field);
  PetscCall(VecDestroy(&status->mode));
  PetscCall(PetscFree(field));
  PetscCall(ierr);
  PetscFunctionReturn(0);
}
