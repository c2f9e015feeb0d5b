#include "core/latinimpl.h"

/*
   Settings of the method: setters, getters, and the options that call the setters. After a change the next set-up rebuilds everything.
*/

const char *const LatinVariants[]       = {"none", "macro", "corner", "published", "primal", "auto", "LatinVariant", "LATIN_VARIANT_", NULL};
const char *const LatinModesTypes[]     = {"affine", "rigid", "LatinModesType", "LATIN_MODES_", NULL};
const char *const LatinDirectionTypes[] = {"scalar", "diagonal", "block", "schur", "auto", "LatinDirectionType", "LATIN_DIRECTION_", NULL};

const char *const LatinPrecisions[] = {"double", "single", "auto", "LatinPrecision", "LATIN_PRECISION_", NULL};

const char *const LatinPartitioners[] = {"auto", "metis", "parallel", "LatinPartitioner", "LATIN_PARTITIONER_", NULL};

/* Sets a member; if it changes, latin->stale */
#define LatinChange(latin, member, value) \
  do { \
    if ((latin)->member != (value)) (latin)->stale = PETSC_TRUE; \
    (latin)->member = (value); \
  } while (0)

/*@
  LatinSetVariant - Sets which interface dofs are in the coarse problem: those of weak interfaces, section 4, or all.

  Logically collective on latin; a change makes the next set-up rebuild everything

  Input Parameters:
+ latin   - of a solver
- variant - `LATIN_VARIANT_NONE`, `LATIN_VARIANT_MACRO`, `LATIN_VARIANT_CORNER`, `LATIN_VARIANT_PUBLISHED`: unknowns of weak interfaces, sections 4.1 to 4.4; `LATIN_VARIANT_PRIMAL`: all interfaces; `LATIN_VARIANT_AUTO`: primal, or corner if most subdomains repeat others

  Options Database Key:
. -snes_latin_variant <auto,primal,corner,macro,none,published> - or -pc_latin_variant

  Level: intermediate

.seealso: `LatinGetVariant()`
@*/
PetscErrorCode LatinSetVariant(Latin latin, LatinVariant variant)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(latin, LATIN_CLASSID, 1);
  PetscCall(LatinCheckChoice_Private((PetscObject)latin, LatinVariants, (int)variant));
  LatinChange(latin, variant, variant);
  PetscFunctionReturn(0);
}

/*@
  LatinGetVariant - Gets which interface dofs are in the coarse problem.

  Not collective

  Input Parameter:
. latin - of a solver

  Output Parameter:
. variant - as set, by default `LATIN_VARIANT_AUTO` of a SNES, `LATIN_VARIANT_CORNER` of a KSP or PC

  Level: intermediate

.seealso: `LatinSetVariant()`
@*/
PetscErrorCode LatinGetVariant(Latin latin, LatinVariant *variant)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(latin, LATIN_CLASSID, 1);
  PetscAssertPointer(variant, 2);
  *variant = latin->variant;
  PetscFunctionReturn(0);
}

/*@
  LatinSetModes - Sets the macro fields of strong interfaces, section 3.2, and the threshold of local low-energy fields.

  Logically collective on latin

  Input Parameters:
+ type      - affine fields, or rigid motions
- threshold - eigenvalue, relative to the search direction, below which local low-energy fields are macro; 0: none, PETSC_DEFAULT: automatic

  Options Database Keys:
+ -snes_latin_modes <affine,rigid>    - or -pc_latin_modes, -ksp_latin_modes
- -snes_latin_modes_local <threshold> - or -pc_latin_modes_local, -ksp_latin_modes_local

  Level: intermediate

.seealso: `LatinGetModes()`
@*/
PetscErrorCode LatinSetModes(Latin latin, LatinModesType type, PetscReal threshold)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(latin, LATIN_CLASSID, 1);
  PetscCall(LatinCheckChoice_Private((PetscObject)latin, LatinModesTypes, (int)type));
  PetscValidLogicalCollectiveReal(latin, threshold, 3);
  PetscCheck((threshold >= 0.0 || threshold == (PetscReal)PETSC_DEFAULT) && !PetscIsInfOrNanReal(threshold), PetscObjectComm((PetscObject)latin), PETSC_ERR_ARG_OUTOFRANGE,
             "-%smodes_local, LatinSetModes(): The threshold of local modes is %g; it is a positive number (0: none, -2: automatic)", LatinPrefix(&latin->sub)[0] ? LatinPrefix(&latin->sub) : "{snes,pc,ksp}_latin_", (double)threshold);
  LatinChange(latin, macro.type, type);
  LatinChange(latin, spectral.threshold, threshold);
  PetscFunctionReturn(0);
}

/*@
  LatinGetModes - Gets the macro fields of strong interfaces, and the threshold of local low-energy fields.

  Not collective

  Input Parameter:
. latin - of a solver

  Output Parameters:
+ type      - affine fields, the default, or rigid motions
- threshold - eigenvalue, relative to the search direction; 0: none; PETSC_DEFAULT, the default: automatic

  Level: intermediate

  Note:
  Pass NULL for what is not needed.

.seealso: `LatinSetModes()`
@*/
PetscErrorCode LatinGetModes(Latin latin, LatinModesType *type, PetscReal *threshold)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(latin, LATIN_CLASSID, 1);
  if (type) *type = latin->macro.type;
  if (threshold) *threshold = latin->spectral.threshold;
  PetscFunctionReturn(0);
}

/*@
  LatinSetDirection - Sets the micro search direction of the interfaces (26), (27).

  Logically collective on latin

  Input Parameters:
+ type  - approximation of the stiffness of the subdomains
- value - scalar direction: d, force/length; others: fraction of the interface stiffness; 0: automatic.
          The fraction, or d relative to the stiffness of interfaces, is between 1e-10 and 1e10 (single precision: 1e-4 and 1e4)

  Options Database Keys:
+ -snes_latin_direction <scalar,diagonal,block,schur> - or -pc_latin_direction (auto besides), -ksp_latin_direction
- -snes_latin_direction_value <value>

  Level: intermediate

.seealso: `LatinGetDirection()`
@*/
PetscErrorCode LatinSetDirection(Latin latin, LatinDirectionType type, PetscReal value)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(latin, LATIN_CLASSID, 1);
  PetscCall(LatinCheckChoice_Private((PetscObject)latin, LatinDirectionTypes, (int)type));
  PetscValidLogicalCollectiveReal(latin, value, 3);
  PetscCheck(value >= 0.0 && !PetscIsInfOrNanReal(value), PetscObjectComm((PetscObject)latin), PETSC_ERR_ARG_OUTOFRANGE,
             "-snes_latin_direction_value, LatinSetDirection(): The direction value is %g; it is a positive number (0: automatic), but for scalar directions a fraction from %g to %g", (double)value, 1.0 / LATIN_DIRECTION_RANGE,
             LATIN_DIRECTION_RANGE);
  PetscCheck(!(value > 0.0) || type == LATIN_DIRECTION_SCALAR || (value * LATIN_DIRECTION_RANGE >= 1.0 && value <= LATIN_DIRECTION_RANGE), PetscObjectComm((PetscObject)latin), PETSC_ERR_ARG_OUTOFRANGE,
             "-snes_latin_direction_value, LatinSetDirection(): The direction value is %g; with the direction %s it is a fraction of the interface stiffness, from %g to %g (0: automatic)", (double)value, LatinDirectionTypes[type],
             1.0 / LATIN_DIRECTION_RANGE, LATIN_DIRECTION_RANGE);
  LatinChange(latin, dir.type, type);
  LatinChange(latin, dir.value, value);
  PetscFunctionReturn(0);
}

/*@
  LatinGetDirection - Gets the micro search direction of the interfaces.

  Not collective

  Input Parameter:
. latin - of a solver

  Output Parameters:
+ type  - as set, by default `LATIN_DIRECTION_SCHUR`, of a PC `LATIN_DIRECTION_AUTO`
- value - as set; 0, the default: automatic

  Level: intermediate

  Note:
  Pass NULL for what is not needed.

.seealso: `LatinSetDirection()`, `LatinGetStatistics()`
@*/
PetscErrorCode LatinGetDirection(Latin latin, LatinDirectionType *type, PetscReal *value)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(latin, LATIN_CLASSID, 1);
  if (type) *type = latin->dir.type;
  if (value) *value = latin->dir.value;
  PetscFunctionReturn(0);
}

/*@
  LatinSetPrecision - Sets the precision of the factors of variant primal of SNES latin. A linear stage solves for the increment of
  the displacements, and so corrects the rounding errors of the last one (iterative refinement). A factor in single precision
  takes half the memory and time. The set-up tests its accuracy, and factors in double precision if it is too low.

  Logically collective on latin

  Input Parameters:
+ latin     - of a SNES
- precision - `LATIN_PRECISION_DOUBLE`, `LATIN_PRECISION_SINGLE`, `LATIN_PRECISION_AUTO`

  Options Database Key:
. -snes_latin_precision <double,single,auto> - auto: single precision for factors larger than a cache

  Level: advanced

.seealso: `LatinGetPrecision()`
@*/
PetscErrorCode LatinSetPrecision(Latin latin, LatinPrecision precision)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(latin, LATIN_CLASSID, 1);
  PetscCall(LatinCheckChoice_Private((PetscObject)latin, LatinPrecisions, (int)precision));
  LatinChange(latin, precision, precision);
  PetscFunctionReturn(0);
}

/*@
  LatinGetPrecision - Gets the precision of the factors of variant primal.

  Not collective

  Input Parameter:
. latin - of a solver

  Output Parameter:
. precision - as set, by default `LATIN_PRECISION_AUTO` of a SNES, `LATIN_PRECISION_DOUBLE` of a KSP or PC

  Level: advanced

.seealso: `LatinSetPrecision()`
@*/
PetscErrorCode LatinGetPrecision(Latin latin, LatinPrecision *precision)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(latin, LATIN_CLASSID, 1);
  PetscAssertPointer(precision, 2);
  *precision = latin->precision;
  PetscFunctionReturn(0);
}

/*@
  LatinSetSubdomains - Sets the number of subdomains of a structure, or into which the pieces of a `MATIS` are merged; 0: automatic.

  Logically collective on latin

  Input Parameters:
+ latin      - of a solver
- subdomains - their number over all ranks, 0: automatic

  Options Database Key:
. -snes_latin_subdomains <n> - or -pc_latin_subdomains, -ksp_latin_subdomains

  Level: beginner

.seealso: `LatinSetPartition()`
@*/
PetscErrorCode LatinSetSubdomains(Latin latin, PetscInt subdomains)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(latin, LATIN_CLASSID, 1);
  PetscValidLogicalCollectiveInt(latin, subdomains, 2);
  PetscCheck(subdomains >= 0, PetscObjectComm((PetscObject)latin), PETSC_ERR_ARG_OUTOFRANGE, "%" PetscInt_FMT " subdomains: the number is positive (0: automatic)", subdomains);
  LatinChange(latin, partition.subdomains, subdomains);
  PetscFunctionReturn(0);
}

/*@
  LatinSetPartition - Sets the subdomain of each link, in place of METIS.

  Logically collective on latin

  Input Parameters:
+ links     - links of this rank
- subdomain - [links] subdomain of each link in the caller's order, numbered from 0 without gaps over all ranks; NULL: METIS

  Level: intermediate

  Note:
  An `IS` of the same numbers, composed on the DM of the structure by `PetscObjectCompose()` under the name "subdomains", is the
  default partition of all solvers.

.seealso: `LatinSetSubdomains()`, `LatinGetPartition()`
@*/
PetscErrorCode LatinSetPartition(Latin latin, PetscInt links, const PetscInt subdomain[])
{
  PetscInt *given = NULL;

  PetscFunctionBegin;
  PetscValidHeaderSpecific(latin, LATIN_CLASSID, 1);
  PetscCheck(!subdomain || links >= 0, PetscObjectComm((PetscObject)latin), PETSC_ERR_ARG_OUTOFRANGE, "The partition is of %" PetscInt_FMT " links; a number of links is not negative", links);
  if (subdomain) {
    PetscCall(PetscMalloc1(links + 1, &given)); /* + 1: not NULL on a rank without links */
    PetscCall(PetscArraycpy(given, subdomain, links));
  }
  PetscCall(PetscFree(latin->partition.given)); /* after the copy: subdomain may be the array of LatinGetPartition() */
  latin->stale           = PETSC_TRUE;
  latin->partition.links = subdomain ? links : 0;
  latin->partition.given = given;
  PetscFunctionReturn(0);
}

/*@
  LatinGetPartition - Gets the subdomain of each link of this rank, as set.

  Not collective; the array is borrowed

  Input Parameter:
. latin - of a solver

  Output Parameters:
+ links     - links of this rank; 0 without a partition
- subdomain - [links] subdomain of each link; NULL without a partition

  Level: intermediate

  Notes:
  Pass NULL for what is not needed. `LatinGetSubdomainOfLinks()` gets the partition in use, also one of METIS.

.seealso: `LatinSetPartition()`, `LatinGetSubdomainOfLinks()`
@*/
PetscErrorCode LatinGetPartition(Latin latin, PetscInt *links, const PetscInt *subdomain[])
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(latin, LATIN_CLASSID, 1);
  if (links) *links = latin->partition.links;
  if (subdomain) *subdomain = latin->partition.given;
  PetscFunctionReturn(0);
}

/*@
  LatinSetPartitioner - Sets the partitioner of a structure, unless the caller sets a partition.

  Logically collective on latin

  Input Parameters:
+ latin       - of a solver
- partitioner - `LATIN_PARTITIONER_AUTO`, `LATIN_PARTITIONER_METIS`, `LATIN_PARTITIONER_PARALLEL`

  Options Database Keys:
+ -snes_latin_partitioner <auto,metis,parallel> - or -pc_latin_partitioner, -ksp_latin_partitioner
- -snes_latin_mat_partitioning_type <type>      - and the other options of PETSc's `MatPartitioning`, for parallel

  Level: advanced

  Note:
  metis gathers all links on one rank. parallel, PETSc's `MatPartitioning` with PT-Scotch or ParMETIS, moves no links, and makes
  connected subdomains. auto is metis on one rank, for few links, and if PETSc has no parallel partitioner; else parallel.

.seealso: `LatinSetSubdomains()`, `LatinSetPartition()`, `LatinGetPartitioner()`
@*/
PetscErrorCode LatinSetPartitioner(Latin latin, LatinPartitioner partitioner)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(latin, LATIN_CLASSID, 1);
  PetscCall(LatinCheckChoice_Private((PetscObject)latin, LatinPartitioners, (int)partitioner));
  LatinChange(latin, partition.partitioner, partitioner);
  PetscFunctionReturn(0);
}

/*@
  LatinGetPartitioner - Gets the partitioner of a structure.

  Not collective

  Input Parameter:
. latin - of a solver

  Output Parameter:
. partitioner - as set, `LATIN_PARTITIONER_AUTO` by default

  Level: advanced

.seealso: `LatinSetPartitioner()`
@*/
PetscErrorCode LatinGetPartitioner(Latin latin, LatinPartitioner *partitioner)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(latin, LATIN_CLASSID, 1);
  PetscAssertPointer(partitioner, 2);
  *partitioner = latin->partition.partitioner;
  PetscFunctionReturn(0);
}

/* Reads the options of the method with the prefix of solver, and sets them in latin. Collective on solver */
PetscErrorCode LatinSetFromOptions_Private(Latin latin, PetscObject solver)
{
  LatinVariant       variant   = latin->variant;
  LatinModesType     modes     = latin->macro.type;
  LatinDirectionType direction = latin->dir.type;
  PetscReal          threshold = latin->spectral.threshold, value = latin->dir.value;
  PetscInt           subdomains  = latin->partition.subdomains;
  LatinPrecision     precision   = latin->precision;
  LatinPartitioner   partitioner = latin->partition.partitioner;

  PetscFunctionBegin;
  PetscCall(LatinSetPrefix_Private(latin, solver));
  PetscObjectOptionsBegin((PetscObject)latin);
  PetscCall(PetscOptionsInt("-subdomains", "Number of subdomains, 0: automatic", "LatinSetSubdomains", subdomains, &subdomains, NULL));
  PetscCall(PetscOptionsEnum("-partitioner", "Partitioner: METIS on one rank, or a parallel one", "LatinSetPartitioner", LatinPartitioners, (PetscEnum)partitioner, (PetscEnum *)&partitioner, NULL));
  if (solver->classid != KSP_CLASSID) PetscCall(PetscOptionsEnum("-variant", "Interface dofs in the coarse problem (section 4)", "LatinSetVariant", LatinVariants, (PetscEnum)variant, (PetscEnum *)&variant, NULL));
  PetscCall(PetscOptionsEnum("-modes", "Macro fields of strong interfaces (section 3.2)", "LatinSetModes", LatinModesTypes, (PetscEnum)modes, (PetscEnum *)&modes, NULL));
  PetscCall(PetscOptionsReal("-modes_local", "Eigenvalue threshold of local low-energy fields in the macro space, 0: none, -2: automatic", "LatinSetModes", threshold, &threshold, NULL));
  PetscCall(PetscOptionsEnum("-direction", "Micro search direction of the interfaces", "LatinSetDirection", LatinDirectionTypes, (PetscEnum)direction, (PetscEnum *)&direction, NULL));
  if (solver->classid == SNES_CLASSID) PetscCall(PetscOptionsReal("-direction_value", "Scalar direction (force/length), or fraction of the interface stiffness, 0: automatic", "LatinSetDirection", value, &value, NULL));
  if (solver->classid == SNES_CLASSID) PetscCall(PetscOptionsEnum("-precision", "Precision of factors, auto: single for large ones if accurate enough", "LatinSetPrecision", LatinPrecisions, (PetscEnum)precision, (PetscEnum *)&precision, NULL));
  PetscOptionsEnd();
  PetscCheck(!(threshold > 0.0) || variant == LATIN_VARIANT_CORNER || variant == LATIN_VARIANT_AUTO, PetscObjectComm(solver), PETSC_ERR_SUP,
             "-%smodes_local needs -%svariant corner: with other variants local fields of interfaces that share nodes slow the iteration down", LatinPrefix(&latin->sub), LatinPrefix(&latin->sub));
  PetscCall(LatinSetVariant(latin, variant));
  PetscCall(LatinSetModes(latin, modes, threshold));
  PetscCall(LatinSetDirection(latin, direction, value));
  PetscCall(LatinSetSubdomains(latin, subdomains));
  PetscCall(LatinSetPartitioner(latin, partitioner));
  PetscCall(LatinSetPrecision(latin, precision));
  PetscFunctionReturn(0);
}
