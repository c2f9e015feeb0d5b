#include "error/latinerror.h"

/*
   Error of a solution on demand: in digits, with the causes of lost digits, or as a bound in the energy norm of a linear
   structure.

   Near a solution u, with the tangent stiffness K, a small force r changes it by K^-1 r. So

     unbalance  r = B^t tau(u) - F: distance of u to the equilibrium of the structure as stored;
     rounding   an elongation n (u_b - u_a) is a difference of rounded numbers, wrong by eps (|n u_a| + |n u_b|), and its
                tension by eps of itself: the error of any solver in this precision;
     places     rounded coordinates: the direction of a link is known to eps |x| / length only, which matters far from the
                origin and between close nodes;
     values     rounded stiffnesses, initial elongations and loads: the error of the data.

   The last three are sums over links of independent roundings. A few random samples give their root mean square:
   with r a sum of terms of random sign, the expected square of K^-1 r is the sum of the squares [C. S. Kenney, A. J. Laub,
   SIAM J. Sci. Comput. 15 (1994): small-sample statistical condition estimates]. Divided by eps it is the condition number of
   this solution, not of the worst right-hand side.

   The energy norm of an error e = K^-1 r is that of the statically admissible tensions k B e [W. Prager, J. L. Synge]. Conjugate
   gradients give a lower bound e_k, |e|^2 = |e_k|^2 + |e - e_k|^2. The remainder is at most the residual in the norm of the
   preconditioner over its least eigenvalue, 1 / (1 + beta), with beta the largest ratio of springs of the search
   direction to K [the argument of J. Mandel, C. R. Dohrmann for balancing by constraints].
*/

#define LATIN_DIGITS_RTOL    1e-4                          /* rtol of a linear solve: an order of magnitude is enough */
#define LATIN_DIGITS_MOST    1000                          /* most iterations of a linear solve */
#define LATIN_DIGITS_SAMPLES 3                             /* samples of random roundings: accurate to a tenth, where an order of magnitude is enough */
#define LATIN_DIGITS_FLOOR   LatinByPrecision(1e-8, 1e-5)  /* stiffness of slack links, relative to the least one: keeps K regular */
#define LATIN_DIGITS_UNIT    (0.5 * PETSC_MACHINE_EPSILON) /* unit roundoff */
#define LATIN_BOUND_SPRINGS  100.0                         /* assumed upper bound of 1 + beta; at a residual of 1e-4 the bound hardly depends on it */

typedef enum { LATIN_DIGITS_ROUNDING, LATIN_DIGITS_PLACES, LATIN_DIGITS_VALUES, LATIN_DIGITS_KINDS } LatinDigitsKind;

/* Linearisation around a solution */
typedef struct {
  LatinStructure structure;
  Vec            u;
  Vec            tangent; /* tangent stiffnesses of the links, borrowed from the matrix */
  KSP            ksp;
  Vec            r, moved; /* forces, and K^-1 r */
  PetscReal     *x;        /* [vertices][dim] coordinates */
} LatinAround;

/* Returns a random sign for a number of an entity of the whole structure, independent of the number of ranks */
static inline PetscReal LatinDigitsSign(PetscInt entity, PetscInt number)
{
  return LatinMix(((uint64_t)entity << 8) ^ (uint64_t)number) & 1 ? 1.0 : -1.0;
}

/*
   Adds to f the forces due to the rotation of link l by random rounding of its coordinates. tau: its tension, k: its tangent stiffness. None for
   links with a direction of their own
*/
static void LatinDigitsTurn(const LatinAround *around, PetscInt l, PetscInt first, const PetscScalar a[], PetscReal tau, PetscReal k, PetscScalar f[])
{
  LatinStructure   structure = around->structure;
  const PetscInt   dim = structure->dim, link = structure->links_start + l, *end = structure->ends + 2 * l;
  const PetscReal *n = structure->direction + dim * l, *xa = around->x + dim * end[0], *xb = around->x + dim * end[1];
  PetscReal        turn[3] = {0.0, 0.0, 0.0}, apart[3], length = 0.0, along = 0.0, stretch = 0.0;

  for (PetscInt c = 0; c < dim; c++) apart[c] = xb[c] - xa[c];
  if (LatinStructureOwnDirection(structure, l, apart)) return;
  for (PetscInt c = 0; c < dim; c++) {
    turn[c] = LATIN_DIGITS_UNIT * (LatinDigitsSign(link, first + 2 * c) * xa[c] + LatinDigitsSign(link, first + 2 * c + 1) * xb[c]);
    length += PetscSqr(apart[c]);
    along += n[c] * turn[c];
  }
  length = PetscSqrtReal(length);
  for (PetscInt c = 0; c < dim; c++) { /* orthogonal to the link: stiffness and rest length are other data */
    turn[c] = (turn[c] - along * n[c]) / length;
    stretch += turn[c] * PetscRealPart(a[dim * end[1] + c] - a[dim * end[0] + c]);
  }
  LatinStructureAddForce(structure, l, k * stretch, f);
  for (PetscInt c = 0; c < dim; c++) {
    f[dim * end[0] + c] -= tau * turn[c];
    f[dim * end[1] + c] += tau * turn[c];
  }
}

/* Computes around->r, nodal forces due to random rounding of one kind. Collective on structure */
static PetscErrorCode LatinDigitsForces_Private(const LatinAround *around, LatinDigitsKind kind, PetscInt sample)
{
  LatinStructure     structure = around->structure;
  const PetscInt     dim = structure->dim, first = 16 * sample;
  Vec                ul, rl, r = around->r;
  const PetscScalar *a, *kt, *load;
  PetscScalar       *f;
  PetscInt           start, past;

  PetscFunctionBegin;
  PetscCall(LatinStructureOpen_Private(structure, structure->vertex_prescribed, around->u, &ul, &a));
  PetscCall(LatinStructureOpenForces_Private(structure, &rl, &f));
  PetscCall(VecGetArrayRead(around->tangent, &kt));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscInt   link = structure->links_start + l, *end = structure->ends + 2 * l;
    const PetscReal  e = LatinStructureElongation(structure, l, a), e0 = structure->e0[l], tau = LatinStructureTension(structure, NULL, l, e + e0), k = PetscRealPart(kt[l]);
    const PetscReal *n = structure->direction + dim * l;

    if (kind == LATIN_DIGITS_ROUNDING) {
      PetscReal most = PetscAbsReal(e0);

      for (PetscInt c = 0; c < dim; c++) most += PetscAbsReal(n[c]) * (PetscAbsScalar(a[dim * end[0] + c]) + PetscAbsScalar(a[dim * end[1] + c]));
      LatinStructureAddForce(structure, l, LATIN_DIGITS_UNIT * LatinDigitsSign(link, first) * (k * most + PetscAbsReal(tau)), f);
    } else if (kind == LATIN_DIGITS_VALUES) LatinStructureAddForce(structure, l, LATIN_DIGITS_UNIT * (LatinDigitsSign(link, first) * tau + LatinDigitsSign(link, first + 1) * k * e0), f);
    else LatinDigitsTurn(around, l, first, a, tau, k, f);
  }
  PetscCall(VecRestoreArrayRead(around->tangent, &kt));
  PetscCall(LatinStructureCloseForces_Private(structure, &rl, &f, NULL, NULL, r));
  PetscCall(LatinStructureClose_Private(structure, &ul, &a));
  if (kind != LATIN_DIGITS_VALUES) PetscFunctionReturn(0);
  PetscCall(VecGetOwnershipRange(r, &start, &past));
  PetscCall(VecGetArray(r, &f));
  PetscCall(VecGetArrayRead(structure->load, &load));
  for (PetscInt i = 0; i < past - start; i++) f[i] += LATIN_DIGITS_UNIT * LatinDigitsSign(start + i, first + 2) * load[i];
  PetscCall(VecRestoreArrayRead(structure->load, &load));
  PetscCall(VecRestoreArray(r, &f));
  PetscFunctionReturn(0);
}

/* Creates CG with PC latin on the tangent stiffness at the solution of snes, with a small stiffness of slack links. Collective on snes */
static PetscErrorCode LatinAroundCreate_Private(SNES snes, const char what[], LatinAround *around)
{
  MPI_Comm    comm = PetscObjectComm((PetscObject)snes);
  const char *prefix;
  PetscReal   least;
  PC          pc;
  Mat         A;

  PetscFunctionBegin;
  PetscCall(SNESLatinFindStructure_Private(snes, &around->structure));
  PetscCheck(around->structure, comm, PETSC_ERR_ORDER, "%s of a solution needs a structure: LatinStructureAttachSNES() comes first (in Python, latinpc.Structure(...).attach(snes))", what);
  PetscCall(LatinStructureCheckRigid_Private(around->structure, "An error estimate by the tangent stiffness"));
  PetscCall(LatinStructureCheckLinear_Private(around->structure, "Error estimates by the tangent stiffness are for"));
  PetscCall(SNESGetSolution(snes, &around->u));
  PetscCheck(around->u, comm, PETSC_ERR_ORDER, "%s is of a solution: call SNESSolve() first", what);
  PetscCall(LatinStructureStiffnessRange_Private(around->structure, &least, NULL));
  PetscCall(LatinTangentCreate_Private(around->structure, &A));
  PetscCall(LatinTangentCompute_Private(around->structure, around->u, LATIN_DIGITS_FLOOR * least, A, &around->tangent));
  PetscCall(KSPCreate(comm, &around->ksp));
  PetscCall(PetscObjectSetOptions((PetscObject)around->ksp, ((PetscObject)snes)->options));
  PetscCall(SNESGetOptionsPrefix(snes, &prefix));
  PetscCall(KSPSetOptionsPrefix(around->ksp, prefix));
  PetscCall(KSPAppendOptionsPrefix(around->ksp, "latin_digits_"));
  PetscCall(KSPSetType(around->ksp, KSPCG));
  PetscCall(KSPSetNormType(around->ksp, KSP_NORM_NATURAL));
  /* natural norm: forces of stiff links must not dominate those of soft ones */
  PetscCall(KSPSetTolerances(around->ksp, LATIN_DIGITS_RTOL, 0.0, PETSC_MAX_REAL, LATIN_DIGITS_MOST));
  PetscCall(MatSetDM(A, around->structure->dm)); /* gives PC latin the structure */
  PetscCall(KSPSetOperators(around->ksp, A, A));
  PetscCall(KSPGetPC(around->ksp, &pc));
  PetscCall(PCSetType(pc, PCLATIN));
  PetscCall(KSPSetFromOptions(around->ksp));
  PetscCall(MatDestroy(&A));
  PetscCall(VecDuplicate(around->u, &around->r));
  PetscCall(VecDuplicate(around->u, &around->moved));
  PetscCall(PetscMalloc1(around->structure->dim * around->structure->vertices, &around->x));
  PetscCall(LatinSFBcast_Private(around->structure->vertex_sf, around->structure->dim, MPIU_REAL, around->structure->x, around->x));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinAroundDestroy_Private(LatinAround *around)
{
  PetscFunctionBegin;
  PetscCall(KSPDestroy(&around->ksp));
  PetscCall(PetscFree(around->x));
  PetscCall(VecDestroy(&around->moved));
  PetscCall(VecDestroy(&around->r));
  PetscFunctionReturn(0);
}

/* Solves moved = K^-1 r. Collective */
static PetscErrorCode LatinAroundSolve_Private(const LatinAround *around)
{
  KSPConvergedReason reason;
  PetscReal          norm;

  PetscFunctionBegin;
  PetscCall(VecNorm(around->r, NORM_2, &norm));
  PetscCheck(!PetscIsInfOrNanReal(norm), PetscObjectComm((PetscObject)around->ksp), PETSC_ERR_FP, "Displacements or loads are not finite: their error cannot be estimated");
  PetscCall(KSPSolve(around->ksp, around->r, around->moved));
  PetscCall(KSPGetConvergedReason(around->ksp, &reason));
  PetscCheck(reason > 0, PetscObjectComm((PetscObject)around->ksp), PETSC_ERR_NOT_CONVERGED, "The error of the solution cannot be estimated: conjugate gradients on its tangent stiffness end with %s; see -latin_digits_ksp_monitor",
             KSPConvergedReasons[reason]);
  PetscFunctionReturn(0);
}

/* Computes part = |K^-1 r| / |u|. Collective */
static PetscErrorCode LatinDigitsMove_Private(const LatinAround *around, PetscReal *part)
{
  PetscReal norm, size;

  PetscFunctionBegin;
  PetscCall(LatinAroundSolve_Private(around));
  PetscCall(VecNorm(around->moved, NORM_2, &norm));
  PetscCall(VecNorm(around->u, NORM_2, &size));
  *part = size > 0.0 ? norm / size : norm > 0.0 ? INFINITY : 0.0;
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinGetDigits_Private(SNES snes, PetscReal *unbalance, PetscReal *const found[LATIN_DIGITS_KINDS])
{
  LatinAround around = {NULL};
  PetscReal   one;

  PetscFunctionBegin;
  PetscCall(LatinAroundCreate_Private(snes, "The number of digits", &around));
  if (unbalance) {
    PetscCall(SNESComputeFunction(snes, around.u, around.r));
    PetscCall(LatinDigitsMove_Private(&around, unbalance));
  }
  for (PetscInt kind = 0; kind < LATIN_DIGITS_KINDS; kind++) {
    if (!found[kind]) continue;
    *found[kind] = 0.0;
    for (PetscInt sample = 0; sample < LATIN_DIGITS_SAMPLES; sample++) {
      PetscCall(LatinDigitsForces_Private(&around, (LatinDigitsKind)kind, sample));
      PetscCall(LatinDigitsMove_Private(&around, &one));
      *found[kind] += one * one / LATIN_DIGITS_SAMPLES;
    }
    *found[kind] = PetscSqrtReal(*found[kind]);
  }
  PetscCall(LatinAroundDestroy_Private(&around));
  PetscFunctionReturn(0);
}

/* Adds an upper bound of the energy norm of K^-1 r to *bound. Overwrites around->r. Collective */
static PetscErrorCode LatinBoundAdd_Private(const LatinAround *around, PetscReal *bound)
{
  PetscScalar work;
  PetscReal   left;
  Mat         A;

  PetscFunctionBegin;
  PetscCall(LatinAroundSolve_Private(around));
  PetscCall(KSPGetResidualNorm(around->ksp, &left));
  PetscCall(KSPGetOperators(around->ksp, &A, NULL));
  PetscCall(MatMult(A, around->moved, around->r));
  PetscCall(VecDot(around->moved, around->r, &work));
  *bound += PetscSqrtReal(PetscRealPart(work) + LATIN_BOUND_SPRINGS * PetscSqr(left));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinGetEnergyBound_Private(SNES snes, PetscReal *bound, PetscReal *relative)
{
  LatinAround    around = {NULL};
  PetscReal      upper = 0.0, norm = 0.0, *e;
  PetscBool      bars = PETSC_TRUE;
  LatinStructure structure;

  PetscFunctionBegin;
  PetscCall(SNESLatinFindStructure_Private(snes, &structure));
  for (PetscInt l = 0; structure && l < structure->links_local; l++) bars = (PetscBool)(bars && LatinLaws[structure->law[l]].smooth);
  LatinAgree(PetscObjectComm((PetscObject)snes), !bars, PETSC_ERR_SUP, "The energy bound is for linear structures, and this one has cables or compression-only links: -snes_latin_stop error estimates their error");
  PetscCall(LatinAroundCreate_Private(snes, "The energy bound", &around));
  PetscCall(SNESComputeFunction(snes, around.u, around.r));
  PetscCall(LatinBoundAdd_Private(&around, &upper));
  PetscCall(LatinDigitsForces_Private(&around, LATIN_DIGITS_ROUNDING, 0));
  PetscCall(LatinBoundAdd_Private(&around, &upper));
  PetscCall(PetscMalloc1(structure->links_local, &e));
  PetscCall(LatinStructureElongations_Private(structure, structure->vertex_prescribed, around.u, e));
  for (PetscInt l = 0; l < structure->links_local; l++) norm += structure->stiffness[l] * PetscSqr(e[l]);
  PetscCall(PetscFree(e));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &norm, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)snes)));
  norm = PetscSqrtReal(norm);
  if (bound) *bound = upper;
  if (relative) *relative = upper < norm ? upper / (norm - upper) : upper > 0.0 ? INFINITY : 0.0;
  PetscCall(LatinAroundDestroy_Private(&around));
  PetscFunctionReturn(0);
}

/*@C
  LatinGetDigits - Relative errors of a solution by its unbalance and by rounding.

  Collective on snes

  Input Parameter:
. snes - of any type, after a solve; its DM is that of a structure without rigid links

  Output Parameters:
+ unbalance - error by the unbalance: distance to equilibrium
. rounding  - error by rounding of displacements, elongations and tensions: least error of any solver in this precision
. places    - error by rounding of coordinates
- values    - error by rounding of stiffnesses, initial elongations and loads

  Level: intermediate

  Notes:
  All are relative, in the l2 norm of the free displacements; the last three are root mean squares over random roundings.
  Divided by the unit roundoff, 1.1e-16, they are condition numbers of this solution. Each may be NULL.

  Cost: the set-up of a `PCLATIN` and ten linear solves. Options prefix: `-latin_digits_`.

.seealso: `LatinGetEnergyBound()`, `SNESLatinGetEstimates()`
@*/
PetscErrorCode LatinGetDigits(SNES snes, PetscReal *unbalance, PetscReal *rounding, PetscReal *places, PetscReal *values)
{
  PetscReal *const found[LATIN_DIGITS_KINDS] = {rounding, places, values};

  PetscFunctionBegin;
  PetscValidHeaderSpecific(snes, SNES_CLASSID, 1);
  LatinWatch(PetscObjectComm((PetscObject)snes), LatinGetDigits_Private(snes, unbalance, found));
  PetscFunctionReturn(0);
}

/*@C
  LatinGetEnergyBound - Upper bound of the error of a solution in the energy norm, for linear structures.

  Collective on snes

  Input Parameter:
. snes - of any type, after a solve; its DM is that of a structure of bars only

  Output Parameters:
+ bound    - of |u* - u|, the square root of the sum of k (e* - e)^2 over all links; may be NULL
- relative - of the same over |u*|; may be NULL

  Level: intermediate

  Note:
  Cost: the set-up of a `PCLATIN` and two linear solves. Options prefix: `-latin_digits_`. The residual of these solves counts ten
  times, which covers springs of the search direction up to 100 times the stiffness. The relative bound is infinite if
  the bound is not below the energy norm of the solution.

.seealso: `SNESLatinGetEstimates()`, `LatinStructureComputeErrors()`
@*/
PetscErrorCode LatinGetEnergyBound(SNES snes, PetscReal *bound, PetscReal *relative)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(snes, SNES_CLASSID, 1);
  LatinWatch(PetscObjectComm((PetscObject)snes), LatinGetEnergyBound_Private(snes, bound, relative));
  PetscFunctionReturn(0);
}
