#include "base/room.h"
#include "snes/sneslatinimpl.h"
#include <petscdmshell.h>

#define LATIN_GUESS_ROUNDING 16.0 /* times eps: accuracy of the interface forces of a guess, relative to the forces of the copies */
#define LATIN_OUTER_DEPTH    10   /* depth of the Anderson acceleration (states and residuals), see below */
#define LATIN_GUESS_MOST     50   /* most iterations to this accuracy; one for each number of copies and each pattern of interfaces of a node */

/*
   The article's iteration as a fixed-point problem z = G(z), solved by an inner SNES of the user's choice (prefix -snes_latin_outer_): nrichardson is
   the plain iteration of section 3.3, anderson and others accelerate it. Its function is z - G(z). G, in stages/fixedpointmap.c: the linear stage,
   (42) to (50), then the local stage, (23), (26), (27). Its convergence test is in snes/convergence.c.
*/

/* Computes F(z) = z - G(z): one linear and one local stage. Collective on outer */
PetscErrorCode SNESLatinFixedPoint_Private(SNES outer, Vec z, Vec F, void *ctx)
{
  SNES_Latin *data  = (SNES_Latin *)((SNES)ctx)->data;
  Latin       latin = data->latin;
  PetscInt    k;

  PetscFunctionBegin;
  PetscCall(LatinApply_Private(&latin->linear, z, F));
  PetscCall(LatinParameterObserve_Private(latin, z, F, &data->parameter));
  PetscCall(VecAYPX(F, -1.0, z));
  if (latin->linear.failed) PetscCall(SNESSetFunctionDomainError(outer));
  if (SNESLatinEstimates(data)) PetscCall(LatinEstimateUpdate_Private(latin, data->target, &data->estimate));
  k = latin->linear.applications - 1;
  if (k < data->history_size) {
    data->indicator[k] = latin->linear.indicator;
    data->estimates[k] = data->estimate.value;
    if (data->reference) PetscCall(LatinErrors_Private(&latin->linear, data->reference_copy, &data->error_l2[k], &data->error_energy[k]));
    data->done = k + 1;
  }
  PetscFunctionReturn(0);
}

/* Refuses types that need more than a function, or make one step: they claim convergence without reason, and some crash */
static PetscErrorCode SNESLatinOuterType_Private(SNES snes, const char type[])
{
  PetscBool is;

  PetscFunctionBegin;
  PetscCall(PetscStrInList(type, "aspin,nasm,patch,ngs,ms,ksponly,ksptransposeonly,vinewtonrsls,vinewtonssls,latin", ',', &is));
  PetscCheck(!is, PetscObjectComm((PetscObject)snes), PETSC_ERR_SUP, "-snes_latin_outer_snes_type %s does not iterate to the fixed point of a function alone: take anderson, ngmres, qn, ncg or nrichardson", type);
  PetscFunctionReturn(0);
}

/*
   Sets our defaults for the type of the inner SNES, once per type: Anderson of depth 10, with restarts for structures with rigid laws, since
   differences from before links became taut or slack slow it down; for nrichardson the full step, the article's iteration. PETSc has no setter for
   the depth, only an option; so the default goes through an options database of its own, not the user's. *changed: the user's options must be read
   again
*/
static PetscErrorCode SNESLatinOuterDefaults_Private(SNES snes, PetscBool *changed)
{
  SNES_Latin    *data = (SNES_Latin *)snes->data;
  const char    *type = ((PetscObject)data->outer)->type_name;
  LatinStructure structure;
  PetscBool      same, rigid, is;
  PetscOptions   defaults;
  SNESLineSearch search;

  PetscFunctionBegin;
  PetscCall(SNESLatinFindStructure_Private(snes, &structure));
  rigid = (PetscBool)(structure && structure->rigid_law >= 0);
  PetscCall(PetscStrcmp(type, data->outer_type, &same));
  *changed = (PetscBool)(!same || rigid != data->outer_rigid);
  if (!*changed) PetscFunctionReturn(0);
  PetscCall(SNESLatinOuterType_Private(snes, type));
  PetscCall(PetscStrncpy(data->outer_type, type, sizeof(data->outer_type)));
  data->outer_rigid = rigid;
  PetscCall(PetscStrcmp(type, SNESNRICHARDSON, &is));
  if (is) {
    PetscCall(SNESGetLineSearch(data->outer, &search));
    PetscCall(PetscObjectTypeCompareAny((PetscObject)search, &is, "l2", "secant", "")); /* PETSc's defaults, by version */
    if (is) PetscCall(SNESLineSearchSetType(search, SNESLINESEARCHNONE));
  }
  PetscCall(PetscStrcmp(type, SNESANDERSON, &is));
  if (!is) PetscFunctionReturn(0);
  /* reads the type's options only, without printing: SNESSetFromOptions() would mark all as printed for -help */
  PetscCall(PetscOptionsCreate(&defaults));
  PetscCall(PetscOptionsSetValue(defaults, "-latin_defaults_snes_anderson_m", PetscStringize(LATIN_OUTER_DEPTH)));
  PetscCall(PetscOptionsSetValue(defaults, "-latin_defaults_snes_anderson_restart_type", rigid ? "periodic" : "none"));
  if (rigid) PetscCall(PetscOptionsSetValue(defaults, "-latin_defaults_snes_anderson_restart", "30"));
  PetscCall(PetscOptionsPush(defaults));
  PetscOptionsBegin(PetscObjectComm((PetscObject)snes), "latin_defaults_", "LATIN defaults", NULL);
  PetscCall((*data->outer->ops->setfromoptions)(data->outer, PetscOptionsObject));
  PetscOptionsEnd();
  PetscCall(PetscOptionsPop());
  PetscCall(PetscOptionsDestroy(&defaults));
  PetscFunctionReturn(0);
}

/* Reads the options of the inner SNES whenever those of snes are read; another type gets its own defaults */
PetscErrorCode SNESLatinOuterOptions_Private(SNES snes)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;
  const char *prefix;
  char        type[64] = "";
  PetscBool   changed;

  PetscFunctionBegin;
  PetscCall(SNESGetOptionsPrefix(snes, &prefix));
  PetscCall(SNESSetOptionsPrefix(data->outer, prefix));
  PetscCall(SNESAppendOptionsPrefix(data->outer, "snes_latin_outer_"));
  PetscCall(PetscObjectSetOptions((PetscObject)data->outer, ((PetscObject)snes)->options));
  if (!((PetscObject)data->outer)->type_name) PetscCall(SNESSetType(data->outer, SNESANDERSON));
  PetscCall(SNESLatinOuterDefaults_Private(snes, &changed));
  PetscCall(SNESGetOptionsPrefix(data->outer, &prefix));
  PetscCall(PetscOptionsGetString(((PetscObject)data->outer)->options, prefix, "-snes_type", type, sizeof(type), NULL));
  PetscCall(SNESLatinOuterType_Private(snes, type)); /* before PETSc creates it: aspin crashes without a DM */
  PetscCall(SNESSetFromOptions(data->outer));
  PetscCall(SNESLatinOuterDefaults_Private(snes, &changed));
  if (changed) PetscCall(SNESSetFromOptions(data->outer));
  PetscFunctionReturn(0);
}

PetscErrorCode SNESLatinCreateOuter_Private(SNES snes)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;

  PetscFunctionBegin;
  if (data->outer) PetscFunctionReturn(0);
  PetscCall(SNESCreate(PetscObjectComm((PetscObject)snes), &data->outer));
  PetscCall(PetscObjectIncrementTabLevel((PetscObject)data->outer, (PetscObject)snes, 1));
  PetscCall(SNESLatinOuterOptions_Private(snes));
  PetscFunctionReturn(0);
}

/*
   Prepares the inner SNES for a state of another length. It stays the user's object; its type is created anew, since some types, as qn, do not
   survive SNESReset()
*/
PetscErrorCode SNESLatinOuterReset_Private(SNES snes)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;
  char        type[64];

  PetscFunctionBegin;
  if (data->outer) {
    PetscCall(SNESReset(data->outer));
    PetscCall(PetscStrncpy(type, ((PetscObject)data->outer)->type_name, sizeof(type)));
    PetscCall(SNESSetType(data->outer, SNESKSPONLY)); /* any other type */
    PetscCall(SNESSetType(data->outer, type));
    data->outer_type[0] = 0;
  }
  PetscFunctionReturn(0);
}

/*
   Frees the past states of an accelerated iteration, up to 25, before Newton's method takes memory: each solve of the inner SNES starts without them.
   SNESLatinOuterSetUp_Private() allocates others. Collective on snes
*/
PetscErrorCode SNESLatinOuterForget_Private(SNES snes)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;
  PetscBool   is;
  PetscInt    n;

  PetscFunctionBegin;
  PetscCall(PetscObjectTypeCompareAny((PetscObject)data->outer, &is, SNESANDERSON, SNESNGMRES, "")); /* other types may not survive SNESReset() */
  if (is) PetscCall(SNESReset(data->outer));
  PetscCall(VecGetLocalSize(data->z, &n));
  if (is) LatinRoomTrim(2 * LATIN_OUTER_DEPTH * (size_t)n * sizeof(PetscScalar)); /* returns the memory, since Newton's method need not use the same blocks */
  PetscFunctionReturn(0);
}

/* Sets up the inner SNES for states like data->z */
PetscErrorCode SNESLatinOuterSetUp_Private(SNES snes)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;
  PetscBool   changed, is;
  PetscInt    n;
  DM          shell;
  Vec         F;

  PetscFunctionBegin;
  PetscCall(SNESLatinOuterDefaults_Private(snes, &changed)); /* the caller may have set the type */
  if (changed) PetscCall(SNESSetFromOptions(data->outer));
  PetscCall(VecGetSize(data->z, &n));
  PetscCall(PetscObjectTypeCompare((PetscObject)data->outer, SNESQN, &is));
  if (is && !n) PetscCall(SNESSetType(data->outer, SNESNRICHARDSON)); /* only bars in one subdomain: one linear stage solves, and qn refuses empty states */
  if (data->outer->setupcalled) PetscFunctionReturn(0);
  PetscCall(DMShellCreate(PetscObjectComm((PetscObject)snes), &shell)); /* source of work vectors of the inner SNES */
  PetscCall(DMShellSetGlobalVector(shell, data->z));
  PetscCall(SNESSetDM(data->outer, shell));
  PetscCall(DMDestroy(&shell));
  PetscCall(VecDuplicate(data->z, &F));
  PetscCall(SNESSetFunction(data->outer, F, SNESLatinFixedPoint_Private, snes));
  PetscCall(VecDestroy(&F));
  PetscCall(SNESSetUp(data->outer));
  PetscFunctionReturn(0);
}

/* Computes the forces F of the sides as differences of a potential of the copies, opposite on both sides, and their sum at each copy */
static PetscErrorCode SNESLatinDifferences_Private(Latin latin, const PetscReal potential[], PetscReal F[], PetscReal sum[])
{
  const LatinInterfaces *inter = &latin->inter;

  PetscFunctionBegin;
  for (PetscInt k = 0; k < inter->sides; k++) latin->linear.outgoing[k] = potential[inter->side_dof[k]];
  PetscCall(LatinSFBcast_Private(inter->mate_sf, 1, MPIU_REAL, latin->linear.outgoing, F));
  PetscCall(PetscArrayzero(sum, latin->sub.bs * latin->sub.copies));
  for (PetscInt k = 0; k < inter->sides; k++) {
    F[k] = potential[inter->side_dof[k]] - F[k];
    sum[inter->side_dof[k]] += F[k];
  }
  PetscFunctionReturn(0);
}

/*
   Computes the forces F that subdomains exert on each other, from the unbalanced forces g on their copies of a node, less the mean of the node. With
   an interface between any two of m copies, copy j exerts (g_j - g_i) / m on copy i. If interfaces are left out, as in the variant none, others
   transfer these forces: the least ones, by conjugate gradients in all nodes at once. Collective on latin
*/
static PetscErrorCode SNESLatinInterfaceForces_Private(Latin latin, Vec work, PetscReal F[])
{
  const LatinInterfaces *inter = &latin->inter;
  const LatinSubdomains *sub   = &latin->sub;
  const PetscInt         n = sub->bs * sub->copies, sides = inter->sides;
  PetscReal             *left, *step, *sum, *more, norm[2] = {0.0, 0.0}, least;

  PetscFunctionBegin;
  PetscCall(PetscCalloc4(n, &left, n, &step, n, &sum, sides, &more));
  PetscCall(LatinSum_Private(sub, latin->linear.g, work));
  PetscCall(LatinDistribute_Private(sub, work, left));
  for (PetscInt i = 0; i < n; i++) {
    left[i] = left[i] / sub->multiplicity[i / sub->bs] - latin->linear.g[i];
    step[i] = left[i] / sub->multiplicity[i / sub->bs];
    norm[1] += PetscSqr(left[i]);
  }
  PetscCall(SNESLatinDifferences_Private(latin, step, F, sum));
  PetscCall(PetscArrayzero(step, n)); /* no interface transfers nothing */
  for (PetscInt k = 0; k < sides; k++) step[inter->side_dof[k]] = left[inter->side_dof[k]] - sum[inter->side_dof[k]];
  PetscCall(PetscArraycpy(left, step, n));
  for (PetscInt i = 0; i < n; i++) norm[0] += PetscSqr(left[i]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, norm, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)latin)));
  least = PetscSqr(LATIN_GUESS_ROUNDING * PETSC_MACHINE_EPSILON) * norm[1];
  for (PetscInt it = 0; it < LATIN_GUESS_MOST && norm[0] > least; it++) {
    PetscReal length, before = norm[0];

    norm[1] = 0.0;
    PetscCall(SNESLatinDifferences_Private(latin, step, more, sum));
    for (PetscInt i = 0; i < n; i++) norm[1] += step[i] * sum[i];
    PetscCall(MPIU_Allreduce(MPI_IN_PLACE, norm + 1, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)latin)));
    if (!(norm[1] > 0.0)) break;
    length  = before / norm[1];
    norm[0] = 0.0;
    for (PetscInt k = 0; k < sides; k++) F[k] += length * more[k];
    for (PetscInt i = 0; i < n; i++) {
      left[i] -= length * sum[i];
      norm[0] += PetscSqr(left[i]);
    }
    PetscCall(MPIU_Allreduce(MPI_IN_PLACE, norm, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)latin)));
    for (PetscInt i = 0; i < n; i++) step[i] = left[i] + norm[0] / before * step[i];
  }
  PetscCall(PetscFree4(left, step, sum, more));
  for (PetscInt f = 0; f < inter->count; f++) LatinMacroMicro(&latin->macro, f, PETSC_TRUE, F + inter->interface[f].side_first, latin->linear.lambda);
  PetscFunctionReturn(0);
}

/*
   Computes the state z of the displacements u: links have the tensions of their laws, rigid ones `rigid` ([links_local]; NULL: zero), interfaces the
   unbalanced forces of the subdomains. z is F_hat + d U_hat at a side, tau_hat - l e_hat at a link; that of a solution is a fixed point. Collective
   on snes
*/
PetscErrorCode SNESLatinGuess_Private(SNES snes, Vec u, const PetscReal rigid[], Vec z)
{
  SNES_Latin      *data  = (SNES_Latin *)snes->data;
  Latin            latin = data->latin;
  LatinSubdomains *sub   = &latin->sub;
  const PetscInt   sides = latin->inter.sides;
  PetscReal       *bears;
  PetscScalar     *a;
  Vec              v;

  PetscFunctionBegin;
  PetscCall(PetscCalloc1(sub->links, &bears));
  if (rigid) PetscCall(LatinSFBcast_Private(sub->link_sf, 1, MPIU_REAL, rigid, bears));
  PetscCall(VecDuplicate(u, &v));
  PetscCall(LatinInitialState_Private(&latin->linear, z));
  if (rigid) PetscCall(LatinSFReduce_Private(sub->link_sf, 1, MPIU_REAL, bears, latin->linear.rigid_tension, MPI_REPLACE)); /* the initial state sets zero */
  PetscCall(LatinDistribute_Private(&latin->sub, u, latin->linear.U));
  PetscCall(VecGetArray(z, &a));
  if (sub->part) LatinTurningState(&latin->linear, a + sides);
  for (PetscInt i = 0; i < sub->nonsmooth && !sub->part; i++) {
    const PetscInt  l   = sub->nonsmooth_link[i];
    const LatinLaw *law = &LatinLaws[sub->law[l]];
    const PetscReal e   = LatinElongation(sub, sub->dim, l, latin->linear.U);

    a[sides + i] = (law->rigid ? bears[l] : law->tension(sub->stiffness[l], e + sub->e0[l], law->ctx)) - sub->stiffness[l] * e;
  }
  PetscCall(LatinGatherForces_Private(&latin->linear, a));
  PetscCall(SNESLatinInterfaceForces_Private(latin, v, a));
  PetscCall(LatinPullFaces_Private(&latin->linear));
  for (PetscInt k = 0; k < sides; k++) a[k] += latin->linear.pull[k];
  PetscCall(VecRestoreArray(z, &a));
  PetscCall(VecDestroy(&v));
  PetscCall(PetscFree(bears));
  PetscFunctionReturn(0);
}

/*
   Sets the initial state: that of the last solve, or extrapolated from the last two; else that of the user's displacements; else the prestressed
   configuration
*/
PetscErrorCode SNESLatinStart_Private(SNES snes)
{
  SNES_Latin            *data = (SNES_Latin *)snes->data;
  const LatinSubdomains *sub  = &data->latin->sub;

  PetscFunctionBegin;
  if (!SNESLatinWarm(data)) {
    if (data->guess || data->latin->sub.part) PetscCall(SNESLatinGuess_Private(snes, snes->vec_sol, NULL, data->z));
    else PetscCall(LatinInitialState_Private(&data->latin->linear, data->z));
    data->has_before = PETSC_FALSE;
    PetscFunctionReturn(0);
  }
  for (PetscInt i = 0; i < sub->bs * sub->copies; i++) /* prescribed displacements may have changed */
    if (sub->fixed[i]) data->latin->linear.U[i] = sub->prescribed[i];
  if (data->warm == LATIN_WARM_START_LAST) PetscFunctionReturn(0);
  if (!data->z_before) PetscCall(VecDuplicate(data->z, &data->z_before));
  if (data->has_before) { /* 2 z - z_before, and z_before takes the place of z */
    PetscCall(VecAYPX(data->z_before, -1.0, data->z));
    PetscCall(VecAXPY(data->z, 1.0, data->z_before));
    PetscCall(VecAYPX(data->z_before, -1.0, data->z));
  } else PetscCall(VecCopy(data->z, data->z_before));
  data->has_before = PETSC_TRUE;
  PetscFunctionReturn(0);
}
