#include "structure/midpoint.h"
#include "structure/structureimpl.h"

/*
   Registered laws, in the same table as the built-in ones: piecewise linear laws from points, and functions of the user. If these have no local
   stage, Newton's method solves it for the strain, as the tension is a nondecreasing function of it.
*/

typedef struct {
  PetscInt   n;     /* number of points */
  PetscReal *x, *t; /* [n] strains; tensions over the stiffness, lengths */
  PetscReal *w;     /* [n] energies, zero at the first point, over the stiffness */
} LatinTable;

static PetscInt room = LATIN_LAW_TANGENT + 1; /* number of laws that fit into the table */

/* Returns the segment of the value x of the strain (add = 0), or of strain + tension (add = 1, local stage); the first and the last are unbounded */
static PetscInt LatinTableFind(const LatinTable *table, PetscReal x, PetscReal add)
{
  PetscInt low = 0, high = table->n - 1;

  while (high - low > 1) {
    const PetscInt middle = (low + high) / 2;

    if (table->x[middle] + add * table->t[middle] <= x) low = middle;
    else high = middle;
  }
  return low;
}

static PetscReal LatinTableSlope(const LatinTable *table, PetscInt i)
{
  return (table->t[i + 1] - table->t[i]) / (table->x[i + 1] - table->x[i]);
}

/* Measured from the zero of the line through the segment: rounding is relative to the tension, not to the points */
static PetscReal LatinLawTension_Table(PetscReal k, PetscReal x, void *ctx)
{
  const LatinTable *table = (const LatinTable *)ctx;
  const PetscInt    i = LatinTableFind(table, x, 0.0), near = PetscAbsReal(table->t[i + 1]) < PetscAbsReal(table->t[i]) ? i + 1 : i;
  const PetscReal   slope = LatinTableSlope(table, i);

  return k * (slope > 0.0 ? slope * (x - (table->x[near] - table->t[near] / slope)) : table->t[i]);
}

static PetscReal LatinLawTangent_Table(PetscReal k, PetscReal x, void *ctx)
{
  const LatinTable *table = (const LatinTable *)ctx;

  return k * LatinTableSlope(table, LatinTableFind(table, x, 0.0));
}

static PetscReal LatinLawEnergy_Table(PetscReal k, PetscReal x, void *ctx)
{
  const LatinTable *table = (const LatinTable *)ctx;
  const PetscInt    i     = LatinTableFind(table, x, 0.0);
  const PetscReal   d     = x - table->x[i];

  return k * (table->w[i] + d * (table->t[i] + 0.5 * LatinTableSlope(table, i) * d));
}

/* Solves tau_hat / k + x_hat = y / k + e0 on its segment */
static PetscReal LatinLawLocal_Table(PetscReal k, PetscReal e0, PetscReal y, void *ctx)
{
  const LatinTable *table = (const LatinTable *)ctx;
  const PetscReal   c     = y / k + e0;
  const PetscInt    i     = LatinTableFind(table, c, 1.0);
  const PetscReal   x     = table->x[i] + (c - table->x[i] - table->t[i]) / (1.0 + LatinTableSlope(table, i));

  return y - 2.0 * k * (x - e0);
}

/* Returns the descent datum tau_hat - k e_hat of the local stage with the ascent datum y */
PetscReal LatinLawLocal(PetscInt law, PetscReal k, PetscReal e0, PetscReal y)
{
  const LatinLaw *own = &LatinLaws[law];
  const PetscReal c   = y + k * e0;

  /* x_hat solves tension(x) + k x = c */
  return own->local ? own->local(k, e0, y, own->ctx) : y - 2.0 * k * (LatinLawLength(own, k, 0.0, k, c, NULL, 0.5 * c / k) - e0);
}

/*@C
  LatinLawGetName - Name of a law, built-in or registered, borrowed; NULL if there is no law of this number.

  Not collective

  Input Parameter:
. law - `LatinLawType`, or the number of a registered law

  Output Parameter:
. name - its name, borrowed, or NULL

  Level: advanced

.seealso: `LatinStructureSetLaws()`, `LatinLawRegisterTable()`, `LatinLawRegister()`
@*/
PetscErrorCode LatinLawGetName(PetscInt law, const char *name[])
{
  PetscFunctionBegin;
  PetscAssertPointer(name, 2);
  *name = law < 0 || law >= LatinLawCount ? NULL : LatinLaws[law].name;
  PetscFunctionReturn(0);
}

/*@
  LatinLawGetStiffness - Default stiffness of the links of a law: of a table its steepest slope, or a constant tension over the range of strains; of other laws 0: none.

  Not collective

  Input Parameter:
. law - its number

  Output Parameter:
. stiffness - k, force/length

  Level: advanced

.seealso: `LatinLawGetTension()`, `LatinStructureSetLaws()`
@*/
PetscErrorCode LatinLawGetStiffness(PetscInt law, PetscReal *stiffness)
{
  PetscFunctionBegin;
  PetscCheck(law >= 0 && law < LatinLawCount, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE, "There is no law %" PetscInt_FMT "; laws are numbered from 0 to %" PetscInt_FMT, law, LatinLawCount - 1);
  PetscAssertPointer(stiffness, 2);
  *stiffness = LatinLaws[law].stiffness;
  PetscFunctionReturn(0);
}

/*@
  LatinLawGetTension - Tension of a link at a strain, as equations (2), (4) and (5) give it for bars and cables.

  Not collective

  Input Parameters:
+ law       - its number; a rigid law is an error, as its tension is not a function of the strain
. stiffness - k, force/length, 0: that of `LatinLawGetStiffness()`
- strain    - x = e + e0, length

  Output Parameter:
. tension - force, positive in tension

  Level: advanced

.seealso: `LatinLawFunctions`, `LatinLawGetStiffness()`
@*/
PetscErrorCode LatinLawGetTension(PetscInt law, PetscReal stiffness, PetscReal strain, PetscReal *tension)
{
  PetscReal own;

  PetscFunctionBegin;
  PetscAssertPointer(tension, 4);
  PetscCall(LatinLawGetStiffness(law, &own));
  PetscCheck(!LatinLaws[law].rigid, PETSC_COMM_SELF, PETSC_ERR_SUP, "The law %s is rigid: its tension is no function of the strain. SNESLatinGetTensions() gives that of a solution", LatinLaws[law].name);
  *tension = LatinLaws[law].tension(stiffness > 0.0 ? stiffness : own, strain, LatinLaws[law].ctx);
  PetscFunctionReturn(0);
}

/* Makes room for one more law; the table may move. Not collective */
static PetscErrorCode LatinLawsGrow_Private(void)
{
  LatinLaw *laws;

  PetscFunctionBegin;
  if (LatinLawCount < room) PetscFunctionReturn(0);
  PetscCall(PetscMalloc1(2 * room, &laws));
  PetscCall(PetscArraycpy(laws, LatinLaws, LatinLawCount));
  if (LatinLaws != LatinBuiltInLaws) PetscCall(PetscFree(LatinLaws));
  LatinLaws = laws;
  room *= 2;
  PetscFunctionReturn(0);
}

/*@C
  LatinLawRegister - Adds a constitutive law to the table, for `LatinStructureSetLaws()`; its name appears in messages.

  Not collective; all ranks register the same laws in the same order, as solvers move links between ranks

  Output Parameter:
. law - its number, from `LATIN_LAW_TANGENT` + 1 on

  Level: advanced

  Notes:
  The tension must not decrease with the strain x = e + e0. Its slope should not be much larger than k, the ascent direction of
  the local stage. The functions are called inside the iteration. If `local` is NULL, Newton's method in one variable solves
  the local stage.

.seealso: `LatinLawFunctions`, `LatinLawRegisterTable()`, `LatinStructureSetLaws()`
@*/
PetscErrorCode LatinLawRegister(const char name[], const LatinLawFunctions *functions, PetscInt *law)
{
  PetscFunctionBegin;
  PetscAssertPointer(name, 1);
  PetscAssertPointer(functions, 2);
  PetscAssertPointer(law, 3);
  PetscCheck(functions->tension && functions->tangent && functions->energy, PETSC_COMM_SELF, PETSC_ERR_ARG_NULL, "The law %s needs its tension, its tangent stiffness and its energy as functions of the strain; only the local stage may be left out",
             name);
  PetscCall(LatinRegisterClasses_Private());
  PetscCall(LatinLawsGrow_Private());
  LatinLaws[LatinLawCount] = (LatinLaw){.tension = functions->tension, .tangent = functions->tangent, .energy = functions->energy, .local = functions->local, .ctx = functions->ctx};
  PetscCall(PetscStrallocpy(name, (char **)&LatinLaws[LatinLawCount].name));
  *law = LatinLawCount++;
  PetscFunctionReturn(0);
}

/* Returns the number of points of a table, with their strains and their tensions over the steepest slope; 0 for other laws */
PetscInt LatinLawPoints(PetscInt law, const PetscReal *strain[], const PetscReal *tension[])
{
  const LatinTable *table = (const LatinTable *)LatinLaws[law].ctx;

  if (LatinLaws[law].tension != LatinLawTension_Table) return 0;
  *strain  = table->x;
  *tension = table->t;
  return table->n;
}

/* Whether the law is a table of these points */
static PetscBool LatinTableSame(const LatinLaw *law, PetscInt n, const PetscReal strain[], const PetscReal tension[], PetscReal steepest)
{
  const LatinTable *table = (const LatinTable *)law->ctx;
  PetscBool         same  = (PetscBool)(law->tension == LatinLawTension_Table && table->n == n && law->stiffness == steepest);

  for (PetscInt i = 0; i < n && same; i++) same = (PetscBool)(table->x[i] == strain[i] && table->t[i] == tension[i] / steepest);
  return same;
}

/*@C
  LatinLawRegisterTable - Adds a piecewise linear law, given by n points, to the table.

  Not collective; all ranks register the same laws in the same order, as solvers move links between ranks

  Input Parameters:
+ strain  - [n] increasing values of x = e + e0, lengths; n is at least 2
- tension - [n] tensions at these strains, forces, not decreasing

  Output Parameter:
. law - its number; the same points give the same number

  Level: intermediate

  Note:
  The first and the last segment extend beyond the points. A link of stiffness 0 has the tensions of the table; with
  another stiffness k they are scaled, so that the steepest slope is k. Where the tension is the same everywhere, as in the cable of a
  counterweight, k stands for this tension over the range of the strains.

.seealso: `LatinLawRegister()`, `LatinStructureSetLaws()`
@*/
PetscErrorCode LatinLawRegisterTable(const char name[], PetscInt n, const PetscReal strain[], const PetscReal tension[], PetscInt *law)
{
  LatinLawFunctions functions = {LatinLawTension_Table, LatinLawTangent_Table, LatinLawEnergy_Table, LatinLawLocal_Table, NULL};
  PetscReal         steepest  = 0.0;
  LatinTable       *table;

  PetscFunctionBegin;
  PetscAssertPointer(name, 1);
  PetscCheck(n >= 2, PETSC_COMM_SELF, PETSC_ERR_ARG_SIZ, "The law %s has %" PetscInt_FMT " points; a piecewise linear law takes two or more", name, n);
  PetscAssertPointer(strain, 3);
  PetscAssertPointer(tension, 4);
  PetscAssertPointer(law, 5);
  for (PetscInt i = 0; i < n; i++) {
    PetscCheck(!PetscIsInfOrNanReal(strain[i]) && !PetscIsInfOrNanReal(tension[i]), PETSC_COMM_SELF, PETSC_ERR_FP, "Point %" PetscInt_FMT " of the law %s is not a pair of finite numbers", i, name);
    if (!i) continue;
    PetscCheck(strain[i] > strain[i - 1], PETSC_COMM_SELF, PETSC_ERR_ARG_WRONG, "The elongations of the law %s must increase: point %" PetscInt_FMT " has %g after %g", name, i, (double)strain[i], (double)strain[i - 1]);
    PetscCheck(tension[i] >= tension[i - 1], PETSC_COMM_SELF, PETSC_ERR_ARG_WRONG, "The tension of the law %s must not decrease: point %" PetscInt_FMT " has %g after %g", name, i, (double)tension[i], (double)tension[i - 1]);
    steepest = PetscMax(steepest, (tension[i] - tension[i - 1]) / (strain[i] - strain[i - 1]));
  }
  PetscCheck(!PetscIsInfOrNanReal(steepest), PETSC_COMM_SELF, PETSC_ERR_FP, "Points of the law %s are so near to each other that its stiffness is not a finite number", name);
  if (steepest == 0.0) steepest = PetscAbsReal(tension[0]) / (strain[n - 1] - strain[0]);
  PetscCheck(steepest > 0.0 && !PetscIsInfOrNanReal(steepest), PETSC_COMM_SELF, PETSC_ERR_ARG_WRONG, "The law %s has no tension anywhere: leave out its links", name);
  for (*law = LATIN_LAW_TANGENT + 1; *law < LatinLawCount; ++*law)
    if (LatinTableSame(&LatinLaws[*law], n, strain, tension, steepest)) PetscFunctionReturn(0);
  PetscCall(PetscNew(&table));
  PetscCall(PetscMalloc3(n, &table->x, n, &table->t, n, &table->w));
  table->n = n;
  for (PetscInt i = 0; i < n; i++) {
    table->x[i] = strain[i];
    table->t[i] = tension[i] / steepest;
    table->w[i] = i ? table->w[i - 1] + 0.5 * (table->t[i] + table->t[i - 1]) * (table->x[i] - table->x[i - 1]) : 0.0;
  }
  functions.ctx = table;
  PetscCall(LatinLawRegister(name, &functions, law));
  LatinLaws[*law].stiffness = steepest;
  PetscFunctionReturn(0);
}

/* Checks that all ranks have the registered laws up to `last`, tables with the same points: solvers move links between ranks. Collective on comm */
PetscErrorCode LatinLawsSame_Private(MPI_Comm comm, PetscInt last)
{
  PetscReal most[6] = {0.0}; /* number of points, and two sums that tell points apart; their negatives */

  PetscFunctionBegin;
  LatinAgree(comm, last >= LatinLawCount, PETSC_ERR_ARG_INCOMP, "Links have the law %" PetscInt_FMT ", which not all ranks have registered: register the same laws on every rank, in the same order", last);
  for (PetscInt law = LATIN_LAW_TANGENT + 1; law <= last; law++) {
    const PetscReal *x = NULL, *t = NULL;
    const PetscInt   n = LatinLawPoints(law, &x, &t);

    most[0] += n;
    for (PetscInt i = 0; i < n; i++) {
      most[1] += (law + i) * x[i];
      most[2] += (law + i) * t[i] * LatinLaws[law].stiffness;
    }
  }
  for (PetscInt i = 0; i < 3; i++) most[3 + i] = -most[i];
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, most, 6, MPIU_REAL, MPIU_MAX, comm));
  for (PetscInt i = 0; i < 3; i++) PetscCheck(most[i] == -most[3 + i], comm, PETSC_ERR_ARG_INCOMP, "Ranks have registered other points of a table, or tables in another order: register the same laws on every rank, in the same order");
  PetscFunctionReturn(0);
}

/* Frees registered laws at PetscFinalize(): the next PetscInitialize() starts from the built-in laws */
PetscErrorCode LatinLawsFinalize_Private(void)
{
  PetscFunctionBegin;
  while (LatinLawCount > LATIN_LAW_TANGENT + 1) {
    LatinLaw *law = &LatinLaws[--LatinLawCount];

    if (law->tension == LatinLawTension_Table) {
      LatinTable *table = (LatinTable *)law->ctx;

      PetscCall(PetscFree3(table->x, table->t, table->w));
      PetscCall(PetscFree(table));
    }
    PetscCall(PetscFree(law->name));
  }
  if (LatinLaws != LatinBuiltInLaws) PetscCall(PetscFree(LatinLaws));
  LatinLaws = LatinBuiltInLaws;
  room      = LATIN_LAW_TANGENT + 1;
  PetscFunctionReturn(0);
}
