#include "core/latinimpl.h"

/*
   What is asked of the method: setters, and the options that call them. A setter that changes
   something makes the next set-up build everything anew.
*/

const char *const LatinVariants[]       = {"none", "macro", "corner", "published", "primal", "auto", "LatinVariant", "LATIN_VARIANT_", NULL};
const char *const LatinModesTypes[]     = {"affine", "rigid", "LatinModesType", "LATIN_MODES_", NULL};
const char *const LatinDirectionTypes[] = {"scalar", "diagonal", "block", "schur", "auto", "LatinDirectionType", "LATIN_DIRECTION_", NULL};

const char *const LatinPrecisions[] = {"double", "single", "auto", "LatinPrecision", "LATIN_PRECISION_", NULL};

const char *const LatinPartitioners[] = {"auto", "metis", "parallel", "LatinPartitioner", "LATIN_PARTITIONER_", NULL};

/* Sets a member, and notes that it has changed */
#define LatinChange(latin, member, value) \
  do { \
    if ((latin)->member != (value)) (latin)->stale = PETSC_TRUE; \
    (latin)->member = (value); \
  } while (0)

/*@
  LatinSetVariant - What of the interfaces is in the coarse problem: of weak ones, section 4; or all.

  Logically collective on latin; a change makes the next set-up build everything anew

  Options Database Key:
. -snes_latin_variant <auto,primal,corner,macro,none,published> - or -pc_latin_variant

  Level: intermediate
@*/
PetscErrorCode LatinSetVariant(Latin latin, LatinVariant variant)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(latin, LATIN_CLASSID, 1);
  LatinChange(latin, variant, variant);
  PetscFunctionReturn(0);
}

/*@
  LatinSetModes - The macro fields of strong interfaces, section 3.2, and the local ones below a threshold.

  Logically collective on latin

  Input Parameters:
+ type      - affine fields, or rigid motions
- threshold - local low-energy fields with eigenvalues below it, relative to the search direction, are macro; 0: none, PETSC_DEFAULT: automatic

  Options Database Keys:
+ -snes_latin_modes <affine,rigid>    - or -pc_latin_modes, -ksp_latin_modes
- -snes_latin_modes_local <threshold> - or -pc_latin_modes_local, -ksp_latin_modes_local

  Level: intermediate
@*/
PetscErrorCode LatinSetModes(Latin latin, LatinModesType type, PetscReal threshold)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(latin, LATIN_CLASSID, 1);
  PetscCheck((threshold >= 0.0 || threshold == (PetscReal)PETSC_DEFAULT) && !PetscIsInfOrNanReal(threshold), PetscObjectComm((PetscObject)latin), PETSC_ERR_ARG_OUTOFRANGE,
             "-%smodes_local, LatinSetModes(): The threshold of local modes is %g; it is a positive number (0: none, -2: automatic)", LatinPrefix(&latin->sub)[0] ? LatinPrefix(&latin->sub) : "{snes,pc,ksp}_latin_", (double)threshold);
  LatinChange(latin, macro.type, type);
  LatinChange(latin, spectral.threshold, threshold);
  PetscFunctionReturn(0);
}

/*@
  LatinSetDirection - The micro search direction of the interfaces (26), (27).

  Logically collective on latin

  Input Parameters:
+ type  - how much of the stiffness of the subdomains it contains
- value - of a scalar direction its value d, force/length; of the others the fraction of the interface stiffness; 0: automatic.
          The fraction, or d relative to the stiffness of interfaces, is between 1e-10 and 1e10 (single precision: 1e-4 and 1e4)

  Options Database Keys:
+ -snes_latin_direction <scalar,diagonal,block,schur> - or -pc_latin_direction (auto besides), -ksp_latin_direction
- -snes_latin_direction_value <value>

  Level: intermediate
@*/
PetscErrorCode LatinSetDirection(Latin latin, LatinDirectionType type, PetscReal value)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(latin, LATIN_CLASSID, 1);
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
  LatinSetPrecision - The precision of the factors of variant primal of SNES latin. A linear stage solves for the change of
  the displacements, and so corrects what the one before has rounded: a factor in single precision takes half the memory
  and time. Whether it serves is tested at the set-up; where it does not, the factor is made in double precision.

  Logically collective on latin

  Options Database Key:
. -snes_latin_precision <double,single,auto> - auto: single precision where a factor is larger than a cache

  Level: advanced
@*/
PetscErrorCode LatinSetPrecision(Latin latin, LatinPrecision precision)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(latin, LATIN_CLASSID, 1);
  LatinChange(latin, precision, precision);
  PetscFunctionReturn(0);
}

/*@
  LatinSetSubdomains - The number of subdomains of a structure, or to which the pieces of a `MATIS` are joined, 0: automatic.

  Logically collective on latin

  Options Database Key:
. -snes_latin_subdomains <n> - or -pc_latin_subdomains, -ksp_latin_subdomains

  Level: beginner

.seealso: `LatinSetPartition()`
@*/
PetscErrorCode LatinSetSubdomains(Latin latin, PetscInt subdomains)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(latin, LATIN_CLASSID, 1);
  PetscCheck(subdomains >= 0, PetscObjectComm((PetscObject)latin), PETSC_ERR_ARG_OUTOFRANGE, "%" PetscInt_FMT " subdomains: the number is positive (0: automatic)", subdomains);
  LatinChange(latin, partition.subdomains, subdomains);
  PetscFunctionReturn(0);
}

/*@
  LatinSetPartition - The subdomain of each link, in place of METIS.

  Logically collective on latin

  Input Parameters:
+ links     - links of this rank
- subdomain - [links] of each link in the caller's order, counted from 0 without gaps over all ranks; NULL: METIS

  Level: intermediate

  Note:
  An `IS` of the same numbers, composed on the DM of the structure by `PetscObjectCompose()` under the name "subdomains", is the
  partition of all solvers that are given none.

.seealso: `LatinSetSubdomains()`
@*/
PetscErrorCode LatinSetPartition(Latin latin, PetscInt links, const PetscInt subdomain[])
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(latin, LATIN_CLASSID, 1);
  latin->stale           = PETSC_TRUE;
  latin->partition.links = subdomain ? links : 0;
  PetscCall(PetscFree(latin->partition.given));
  if (subdomain) PetscCall(PetscMalloc1(links + 1, &latin->partition.given)); /* not NULL on a rank without links either */
  PetscCall(PetscArraycpy(latin->partition.given, subdomain, latin->partition.links));
  PetscFunctionReturn(0);
}

/*@
  LatinSetPartitioner - Who makes the partition of a structure where the caller gives none.

  Logically collective on latin

  Options Database Keys:
+ -snes_latin_partitioner <auto,metis,parallel> - or -pc_latin_partitioner, -ksp_latin_partitioner
- -snes_latin_mat_partitioning_type <type>      - and the other options of PETSc's `MatPartitioning`, for parallel

  Level: advanced

  Note:
  METIS holds all links on one rank. The parallel one, PETSc's `MatPartitioning` with PT-Scotch or ParMETIS, leaves them where
  they are, and makes connected subdomains. auto: METIS on one rank, for few links, and where PETSc has no other.

.seealso: `LatinSetSubdomains()`, `LatinSetPartition()`
@*/
PetscErrorCode LatinSetPartitioner(Latin latin, LatinPartitioner partitioner)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(latin, LATIN_CLASSID, 1);
  LatinChange(latin, partition.partitioner, partitioner);
  PetscFunctionReturn(0);
}

/* The options of the method, behind the prefix that solver gives it. Collective on solver */
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
  PetscCall(PetscOptionsEnum("-partitioner", "Partitioner: METIS on one rank, or a parallel one on all ranks", "LatinSetPartitioner", LatinPartitioners, (PetscEnum)partitioner, (PetscEnum *)&partitioner, NULL));
  if (solver->classid != KSP_CLASSID) PetscCall(PetscOptionsEnum("-variant", "Interface unknowns of the coarse problem (section 4)", "LatinSetVariant", LatinVariants, (PetscEnum)variant, (PetscEnum *)&variant, NULL));
  PetscCall(PetscOptionsEnum("-modes", "Macro fields of strong interfaces (section 3.2)", "LatinSetModes", LatinModesTypes, (PetscEnum)modes, (PetscEnum *)&modes, NULL));
  PetscCall(PetscOptionsReal("-modes_local", "Threshold of local low-energy macro fields, 0: none, -2: automatic", "LatinSetModes", threshold, &threshold, NULL));
  PetscCall(PetscOptionsEnum("-direction", "Micro search direction of the interfaces", "LatinSetDirection", LatinDirectionTypes, (PetscEnum)direction, (PetscEnum *)&direction, NULL));
  if (solver->classid == SNES_CLASSID) PetscCall(PetscOptionsReal("-direction_value", "Scalar direction (force/length), or fraction of the interface stiffness, 0: automatic", "LatinSetDirection", value, &value, NULL));
  if (solver->classid == SNES_CLASSID)
    PetscCall(
      PetscOptionsEnum("-precision", "Precision of factors that linear stages correct; single: if a test allows it; auto: the same, for large factors", "LatinSetPrecision", LatinPrecisions, (PetscEnum)precision, (PetscEnum *)&precision, NULL));
  PetscOptionsEnd();
  PetscCheck(!(threshold > 0.0) || variant == LATIN_VARIANT_CORNER || variant == LATIN_VARIANT_AUTO, PetscObjectComm(solver), PETSC_ERR_SUP,
             "-%smodes_local needs -%svariant corner: elsewhere the local fields of interfaces that share nodes slow the iteration down", LatinPrefix(&latin->sub), LatinPrefix(&latin->sub));
  PetscCall(LatinSetVariant(latin, variant));
  PetscCall(LatinSetModes(latin, modes, threshold));
  PetscCall(LatinSetDirection(latin, direction, value));
  PetscCall(LatinSetSubdomains(latin, subdomains));
  PetscCall(LatinSetPartitioner(latin, partitioner));
  PetscCall(LatinSetPrecision(latin, precision));
  PetscFunctionReturn(0);
}
