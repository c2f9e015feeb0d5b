#include "error/latinerror.h"

/*
   Are displacements an equilibrium? Iterates that rest prove little: a state may creep, that of a node whose load is small
   beside the search directions of its slack links, or that of rigid links whose tensions grow without end; and a structure
   without equilibrium moves more and more slowly beside the way that it has come. So displacements u are compared
   with the forces r = F - B^t tau(u) that they leave without balance (error/nodalbalance.c):

   - with the row sums D of the stiffness, which is D at most, an energy error is that of D^-1 r at least, an l2 error about;
   - a node between links that are nearly straight is far softer along its displacement than D says, and r moves it by more;
     so does rounding of the directions of their tensions, where prestress holds it: that counts as no error, and leaves fewer digits;
   - in a motion masses alone may hold the structure, and M / h^2 is soft beside links: for the translations t of all free
     displacements, and for u, t.r = t.K e for the error e, so that |e| >= |t.r| / |K t|;
   - the ends of a rigid link that bears are apart by its gap: by what they miss it, u is wrong by 1 / sqrt(2) at least;
   - where a motion comes to rest nothing is left to be relative to. With nodes that are held by masses, errors of r move u by less than
     in D^-1 alone: where rounding of the forces then moves more than the error asked for of u, in the norm of D, so that light
     nodes do not count for more than they weigh, and in the l2 norm, and of what gaps are missed by, these are held as far as digits go;
   - a node where as much force is missing as there is has nothing that holds it. It moves until a link resists;
   - at an equilibrium r.u = 0, while along a mechanism loads work and nothing resists. Their work is compared with that of
     tensions and loads, so that neither units nor stiffnesses matter.
*/

#define LATIN_FORCE_NOISE  8.0                          /* times eps, of the forces that meet at a node: rounding of their sum */
#define LATIN_FORCE_FACTOR 10.0                         /* on the first of the above; then, on structures of all kinds, it is 0.06 of the target at most where that has been met */
#define LATIN_MOVED_FACTOR 1.8                          /* on the second, as on estimates of l2 errors */
#define LATIN_UNHELD       0.5                          /* of the forces at a node: a larger unbalance, and nothing holds it; of the largest of some numbers: so are those that count */
#define LATIN_WORK_LEFT    0.5                          /* part of the work that tensions do not balance: near 0 at a solution of any accuracy, 1 in free fall */
#define LATIN_WORK_CANCELS 0.03                         /* part of the works by themselves below which their sum counts as 0: that of a prestress */
#define LATIN_GAP_NONE     1e3                          /* times eps, of tau / l: displacements of links without gaps that are none */
#define LATIN_POINT        64.0                         /* times eps, of the size of the structure: less than coordinates show */
#define LATIN_GAP_POINT    4.0                          /* the same of gaps and prescribed displacements */
#define LATIN_SOFT         LatinByPrecision(1e-7, 1e-4) /* stiffness of a mechanism, relative to that of the softest link */
#define LATIN_PUSH         1e-9                         /* of the loads: less along a step is rounding */
#define LATIN_LOAD_LEFT    0.1                          /* part of the loads that tensions do not balance along a mechanism */
#define LATIN_JAM_STAGES   100                          /* damped linear stages, after which tensions that grow without end show it; 25 find every jam tried, 6 do not */
#define LATIN_JAM_FAR      10.0                         /* times the displacements: so far no displacement meets links that are jammed */

/* What nodes sum up to */
typedef struct {
  PetscReal error;                        /* squares of D^-1 r, in the norm of the estimate */
  PetscReal work, pushed, loads;          /* r.u; works of loads and springs to the ground: their sum, and each by itself */
  PetscReal hidden;                       /* squares of the rounding of r */
  PetscReal left, all, load, bearing;     /* squares of r beyond rounding and of all of it, of the loads, of what links bear at nodes */
  PetscReal moved[4], stiff[4], noise[4]; /* t.r, squares of K t, rounding of t.r: translations, then u */
  PetscReal along, blur;                  /* squares of what each node is wrong by along its displacement, and of what rounded directions of tensions move it along that */
  PetscReal u[2], hides[2];               /* squares of u, and of what rounding of r moves, in the norm of D and the l2 norm */
} LatinNodalSums;

/* The size of a structure, the diagonal of the box around its nodes, and the largest prescribed displacement. Collective on structure */
PetscErrorCode LatinStructureSize_Private(LatinStructure structure, PetscReal *size, PetscReal *prescribed)
{
  const PetscInt dim = structure->dim;
  PetscReal      most[7], sum = 0.0; /* -lowest and highest coordinates, prescribed displacement */

  PetscFunctionBegin;
  for (PetscInt k = 0; k < 6; k++) most[k] = -PETSC_MAX_REAL;
  most[6] = 0.0;
  for (PetscInt i = 0; i < dim * structure->nodes_local; i++) {
    most[2 * (i % dim)]     = PetscMax(most[2 * (i % dim)], -structure->x[i]);
    most[2 * (i % dim) + 1] = PetscMax(most[2 * (i % dim) + 1], structure->x[i]);
    if (structure->fixed[i]) most[6] = PetscMax(most[6], PetscAbsReal(structure->prescribed[i]));
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, most, 7, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)structure)));
  for (PetscInt c = 0; c < dim; c++) sum += PetscSqr(most[2 * c] + most[2 * c + 1]);
  *size       = PetscSqrtReal(sum);
  *prescribed = most[6];
  PetscFunctionReturn(0);
}

/* Displacements of so small an l2 norm are less than coordinates show; in a motion no coordinate counts, but the strains that the step starts from. Collective on structure */
PetscErrorCode LatinEquilibriumPoint_Private(LatinStructure structure, PetscReal *least)
{
  PetscReal size = 0.0, prescribed;

  PetscFunctionBegin;
  if (structure->ground) {
    for (PetscInt l = 0; l < structure->links_local; l++) size = PetscMax(size, LatinLaws[structure->law[l]].rigid ? 0.0 : PetscAbsReal(structure->e0[l]));
    PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &size, 1, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)structure)));
  } else PetscCall(LatinStructureSize_Private(structure, &size, &prescribed));
  *least = LATIN_POINT * PETSC_MACHINE_EPSILON * size;
  PetscFunctionReturn(0);
}

/* Are displacements larger than the structure and than what is prescribed? The theory is of small ones, so that few solutions need a proof. Collective on structure */
PetscErrorCode LatinEquilibriumFar_Private(LatinStructure structure, Vec u, PetscBool *far)
{
  PetscReal size, prescribed, most;

  PetscFunctionBegin;
  PetscCall(LatinStructureSize_Private(structure, &size, &prescribed));
  PetscCall(VecNorm(u, NORM_INFINITY, &most));
  *far = (PetscBool)(most > PetscMax(size, prescribed));
  PetscFunctionReturn(0);
}

/* How many nodes or links are listed on all ranks, and the least of them; `mine` has those of this rank. Collective on comm */
static PetscErrorCode LatinList_Private(MPI_Comm comm, PetscInt count, PetscInt mine[], PetscInt *total, PetscInt list[])
{
  PetscMPIInt ranks;
  PetscInt   *all;

  PetscFunctionBegin;
  for (PetscInt i = count; i < LATIN_LISTED; i++) mine[i] = PETSC_MAX_INT;
  PetscCallMPI(MPI_Comm_size(comm, &ranks));
  PetscCall(PetscMalloc1(LATIN_LISTED * ranks, &all));
  PetscCallMPI(MPI_Allgather(mine, LATIN_LISTED, MPIU_INT, all, LATIN_LISTED, MPIU_INT, comm));
  PetscCall(PetscSortInt(LATIN_LISTED * ranks, all));
  PetscCall(PetscArraycpy(list, all, LATIN_LISTED));
  PetscCall(PetscFree(all));
  PetscCall(MPIU_Allreduce(&count, total, 1, MPIU_INT, MPI_SUM, comm));
  PetscFunctionReturn(0);
}

/* Nodes that nothing holds */
typedef struct {
  PetscInt  count, least[LATIN_LISTED]; /* of this rank; the least of their numbers */
  PetscInt  more[2];                    /* without end, hidden by rounding */
  PetscReal sum;                        /* squares of how far they move */
} LatinUnheld;

/* A node that nothing holds is one of them; one that no link would stop has no end, and of some rounding hides it */
static void LatinUnheldNode(const LatinNode *at, PetscInt dim, PetscInt number, LatinUnheld *unheld)
{
  PetscReal push = 0.0, load = 0.0;
  PetscBool mass = PETSC_FALSE;
  PetscInt  last;

  for (PetscInt c = 0; c < dim; c++) {
    push += PetscSqr(at->r[c]);
    load += PetscSqr(at->load[c]);
    if (at->ground[c] > 0.0) mass = PETSC_TRUE;
  }
  push = PetscSqrtReal(push);
  if (mass || push <= LATIN_UNHELD * (at->tension + PetscSqrtReal(load))) return;
  if (push <= LATIN_FORCE_NOISE * PETSC_MACHINE_EPSILON * at->gaps) {
    if (!(load > 0.0)) return;
    unheld->more[1]++;
  }
  last = PetscMin(unheld->count, LATIN_LISTED);
  unheld->count++;
  while (last > 0 && unheld->least[last - 1] > number) {
    if (last < LATIN_LISTED) unheld->least[last] = unheld->least[last - 1];
    last--;
  }
  if (last < LATIN_LISTED) unheld->least[last] = number;
  if (at->resistance > 0.0) unheld->sum += PetscSqr(1.0 / at->resistance);
  else unheld->more[0]++;
}

/* Those of all ranks, and how far they move. Collective on comm */
static PetscErrorCode LatinUnheld_Private(MPI_Comm comm, LatinUnheld *unheld, LatinEquilibrium *found)
{
  PetscFunctionBegin;
  PetscCall(LatinList_Private(comm, unheld->count, unheld->least, &found->nodes, found->node));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, unheld->more, 2, MPIU_INT, MPI_SUM, comm));
  PetscCall(MPIU_Allreduce(&unheld->sum, &found->distance, 1, MPIU_REAL, MPIU_SUM, comm));
  found->distance = unheld->more[0] ? INFINITY : PetscSqrtReal(found->distance);
  found->hidden   = unheld->more[1];
  PetscFunctionReturn(0);
}

/* One component c of a node */
static void LatinSumComponent(const LatinNode *at, PetscInt dim, PetscInt c, PetscBool energy, LatinNodalSums *sum)
{
  const PetscReal ground = at->ground[c], noise = LATIN_FORCE_NOISE * PETSC_MACHINE_EPSILON * at->rounding[c];
  const PetscReal stiff = at->stiffness[c] + ground, left = PetscMax(0.0, PetscAbsReal(at->r[c]) - noise), pushed = (ground * at->u[c] - at->load[c]) * at->u[c];

  sum->left += left * left;
  sum->hidden += noise * noise;
  sum->all += PetscSqr(at->r[c]);
  sum->load += PetscSqr(at->load[c]);
  sum->bearing += c ? 0.0 : PetscSqr(at->bearing);
  if (stiff > 0.0) {
    sum->error += energy ? left * left / stiff : PetscSqr(left / stiff);
    sum->hides[0] += noise * noise / stiff;
    sum->hides[1] += PetscSqr(noise / stiff);
  }
  sum->u[0] += stiff * PetscSqr(at->u[c]);
  sum->u[1] += PetscSqr(at->u[c]);
  sum->work += at->r[c] * at->u[c];
  sum->pushed += pushed;
  sum->loads += ground * at->u[c] * at->u[c] + PetscAbsReal(at->load[c] * at->u[c]); /* of a mass in flight the two cancel */
  sum->moved[c] += at->r[c];
  sum->noise[c] += noise;
  for (PetscInt d = 0; d < dim; d++) sum->stiff[d] += PetscSqr(at->translation[3 * d + c] + (c == d ? ground : 0.0));
  sum->moved[3] += at->r[c] * at->u[c];
  sum->noise[3] += noise * PetscAbsReal(at->u[c]);
  sum->stiff[3] += PetscSqr(at->tangent[c] + ground * PetscAbsReal(at->u[c]));
}

/*
   What a node is wrong by along its displacement, or back along it, where no link that may bear is in the way: what pushes it moves it against the links that
   bear, beyond rounding. Between links that are nearly straight it is softer than row sums say, by orders
*/
static void LatinSumNode(const LatinNode *at, PetscInt dim, PetscBool energy, LatinNodalSums *sum)
{
  PetscReal held = at->held, push = at->slack, size = 0.0;

  for (PetscInt c = 0; c < dim; c++) {
    held += at->ground[c] * PetscSqr(at->u[c]);
    push += at->r[c] * at->u[c];
    size += PetscSqr(at->u[c]);
  }
  if (!(held > 0.0) || at->closed[push > 0.0 ? 1 : 0] > 0.0) return; /* r is B^t tau(u) - F */
  push = PetscMax(0.0, PetscAbsReal(push) - at->hides);
  sum->along += (energy ? held : size) * PetscSqr(PetscMin(1.0, push / held));
  sum->blur += (energy ? held : size) * PetscSqr(PetscMin(1.0, 0.5 * PETSC_MACHINE_EPSILON * at->turns / held));
}

/* What the nodes visited add up to */
typedef struct {
  PetscInt       dim;
  PetscBool      energy;
  LatinNodalSums sum;
  LatinUnheld    unheld;
} LatinNodalJudge;

static void LatinNodeJudge(const LatinNode *at, PetscInt number, void *ctx)
{
  LatinNodalJudge *judge = (LatinNodalJudge *)ctx;

  for (PetscInt c = 0; c < judge->dim; c++) LatinSumComponent(at, judge->dim, c, judge->energy, &judge->sum);
  LatinSumNode(at, judge->dim, judge->energy, &judge->sum);
  LatinUnheldNode(at, judge->dim, number, &judge->unheld);
}

/* By how much rigid links miss their gaps; 0 where nothing moves but by rounding. norm: l2 norm of the displacements; still: a step of a motion is at rest. Collective */
static PetscErrorCode LatinGapError_Private(const LatinNodalBalance *balance, Vec u, PetscReal norm, PetscBool still, PetscReal *missed)
{
  const LatinStructure structure = balance->latin->sub.structure;
  PetscReal            size, prescribed, most;
  PetscBool            moves, gaps;

  PetscFunctionBegin;
  *missed = 0.0;
  if (structure->rigid_law < 0) PetscFunctionReturn(0);
  if (structure->ground && !still) *missed = balance->gap;
  if (structure->ground) PetscFunctionReturn(0); /* no gap and no coordinate counts: closed links let nothing move */
  PetscCall(VecNorm(u, NORM_INFINITY, &most));
  PetscCall(LatinStructureSize_Private(structure, &size, &prescribed));
  size *= PETSC_MACHINE_EPSILON;
  moves = (PetscBool)(norm > LATIN_GAP_NONE * PETSC_MACHINE_EPSILON * PetscSqrtReal(balance->sum.bearing_moves) && most > LATIN_POINT * size);
  gaps  = (PetscBool)(PetscSqrtReal(balance->sum.bearing_gaps) > LATIN_GAP_POINT * size || prescribed > LATIN_GAP_POINT * size);
  if (moves || gaps) *missed = balance->gap;
  PetscFunctionReturn(0);
}

/*
   The verdict on displacements u that leave the forces r without balance: whether they are an equilibrium to a relative
   error of `target`, in the energy or the l2 norm. `more` is a load beside that of the structure, or NULL; `rests`: the
   state of the iteration moves no more but by rounding. Collective on structure
*/
PetscErrorCode LatinEquilibriumCheck_Private(Latin latin, Vec u, Vec r, Vec more, PetscReal target, PetscBool energy, PetscBool rests, LatinEquilibrium *found)
{
  const LatinStructure structure = latin->sub.structure;
  LatinNodalJudge      judge     = {.dim = structure->dim, .energy = energy};
  PetscReal            size, missed, norm, works;
  PetscBool            far;
  LatinNodalSums       sum;
  LatinNodalBalance    balance;

  PetscFunctionBegin;
  PetscCall(PetscMemzero(found, sizeof(*found)));
  PetscCall(VecNorm(u, NORM_2, &size));
  PetscCall(LatinNodalBalance_Private(latin, u, r, more, target, LatinNodeJudge, &judge, &balance));
  sum = judge.sum;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &sum, sizeof(sum) / sizeof(PetscReal), MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  PetscCall(LatinUnheld_Private(PetscObjectComm((PetscObject)structure), &judge.unheld, found));
  found->still = (PetscBool)(structure->ground && PetscSqr(target) * sum.u[0] <= sum.hides[0] && PetscSqr(target) * sum.u[1] <= sum.hides[1] && 0.5 * PetscSqr(target * balance.gap) <= sum.hides[1]);
  PetscCall(LatinGapError_Private(&balance, u, size, found->still, &missed));
  PetscCall(LatinEquilibriumFar_Private(structure, u, &far));

  found->balanced = (PetscBool)(sum.error == 0.0);
  found->left     = PetscSqrtReal(sum.left);
  if (sum.load > 0.0) found->rounding = PetscSqrtReal(sum.hidden / sum.load);
  if (sum.left > 0.0) found->unbalance = PetscSqrtReal(LatinRatio(sum.left, sum.load > 0.0 ? sum.load : sum.bearing));
  if (sum.left > 0.0 || sum.load > 0.0) found->forces = PetscSqrtReal(LatinRatio(sum.all, PetscMax(sum.bearing, sum.load)));
  norm = energy ? PetscSqrtReal(balance.sum.energy) : size;
  if (norm > 0.0) found->error = PetscMax(LATIN_FORCE_FACTOR * PetscSqrtReal(sum.error), PetscSqrtReal(sum.along)) / norm;
  if (norm > 0.0) found->blur = PetscSqrtReal(sum.blur) / norm;
  for (PetscInt d = 0; d < 4 && structure->ground && !energy && norm > 0.0; d++)
    if (sum.stiff[d] > 0.0) found->error = PetscMax(found->error, LATIN_MOVED_FACTOR * (PetscAbsReal(sum.moved[d]) - sum.noise[d]) / (PetscSqrtReal(sum.stiff[d]) * norm));
  missed = PetscMax(missed / PETSC_SQRT2, found->distance);
  if (missed > 0.0) missed = missed < size ? missed / size : 1.0;
  found->error  = PetscMax(found->error, missed);
  found->missed = missed;
  PetscCall(PetscInfo(structure, "Forces without balance: %g of the loads; gaps are missed by %g of the displacements\n", (double)found->unbalance, (double)missed));

  /* the work of the tensions is r.u less that of the loads */
  works = PetscAbsReal(sum.work - sum.pushed) + PetscAbsReal(sum.pushed) + LATIN_WORK_CANCELS * (balance.sum.work + sum.loads);
  if (far && (sum.load > 0.0 || !found->balanced) && PetscAbsReal(sum.work) > LATIN_WORK_LEFT * works) {
    found->verdict = LATIN_UNBOUNDED;
    PetscCall(PetscInfo(structure, "Displacements larger than the structure leave %g of the work of tensions and loads without balance\n", (double)(PetscAbsReal(sum.work) / works)));
  } else if (found->error <= target) found->verdict = LATIN_EQUILIBRIUM;
  else found->verdict = missed > target && (rests || found->hidden) ? LATIN_BELOW_ROUNDING : LATIN_NOT_YET;
  PetscFunctionReturn(0);
}

/* The verdict LATIN_UNBOUNDED, with the nodes that these displacements move. Collective on structure */
PetscErrorCode LatinEquilibriumMoved_Private(LatinStructure structure, Vec step, LatinEquilibrium *found)
{
  const PetscInt dim = structure->dim;
  PetscInt       mine[LATIN_LISTED], count = 0;
  PetscReal     *move, most;

  PetscFunctionBegin;
  PetscCall(VecNorm(step, NORM_INFINITY, &most));
  PetscCall(PetscMalloc1(dim * structure->nodes_local, &move));
  PetscCall(LatinStructureGetDisplacements(structure, step, move));
  for (PetscInt i = 0; i < structure->nodes_local; i++) {
    PetscReal size = 0.0;

    for (PetscInt c = 0; c < dim; c++) size = PetscMax(size, structure->fixed[dim * i + c] ? 0.0 : PetscAbsReal(move[dim * i + c]));
    if (!(size > 0.0) || size < LATIN_UNHELD * most) continue; /* a clamped node does not move, whatever `most` is */
    if (count < LATIN_LISTED) mine[count] = structure->nodes_start + i;
    count++;
  }
  PetscCall(PetscFree(move));
  PetscCall(LatinList_Private(PetscObjectComm((PetscObject)structure), count, mine, &found->nodes, found->node));
  found->verdict  = LATIN_UNBOUNDED;
  found->distance = INFINITY;
  PetscFunctionReturn(0);
}

/*
   A step of Newton's method along which no link resists, however far it goes, and along which the loads push: the energy
   has no least value, and the verdict is LATIN_UNBOUNDED, with the nodes that move. Else *found stays. Links that will
   resist once a gap has closed are no mechanism. r: what was without balance after the step. Collective on structure
*/
PetscErrorCode LatinEquilibriumMechanism_Private(LatinStructure structure, Vec step, Vec r, Vec more, LatinEquilibrium *found)
{
  PetscReal   length, least, resisted, load, beside = 0.0;
  PetscScalar pushed, other = 0.0, left;

  PetscFunctionBegin;
  PetscCall(VecNorm(step, NORM_2, &length));
  if (!(length > 0.0) || PetscIsInfOrNanReal(length)) PetscFunctionReturn(0);
  PetscCall(LatinStructureStiffnessRange_Private(structure, &least, NULL));
  PetscCall(LatinStructureResistFar_Private(structure, step, &resisted));
  PetscCall(VecDot(structure->load, step, &pushed));
  if (more) PetscCall(VecDot(more, step, &other));
  PetscCall(VecDot(r, step, &left));
  PetscCall(VecNorm(structure->load, NORM_2, &load));
  if (more) PetscCall(VecNorm(more, NORM_2, &beside));
  if (resisted > LATIN_SOFT * least * length * length || PetscAbsScalar(left) <= LATIN_LOAD_LEFT * PetscAbsScalar(pushed + other)) PetscFunctionReturn(0);
  if (-PetscRealPart(pushed + other) <= LATIN_PUSH * (load + beside) * length) PetscFunctionReturn(0); /* the step is taken off: a node without load that nothing holds moves by rounding alone */
  PetscCall(LatinEquilibriumMoved_Private(structure, step, found));
  PetscFunctionReturn(0);
}

/*
   Rigid links that no displacement meets together. Their tensions grow for ever, by the same self-stress dtau from one stage
   of the damped iteration, or of the method of multipliers, to the next: B^t dtau = 0, while dtau . x = dtau . (e0 + B u) is not positive for any admissible
   strains x [J. Farkas]. Where dtau . e0 is, by more than B^t dtau can make up for on displacements of the size of the structure, or
   ten times as large as u, there are none, and the verdict is LATIN_JAMMED; else *found stays. `claims`: u would be called the solution,
   and those ten times as large are enough; `stays`: what links miss of their gaps stays, whatever their stiffness: then the work alone is proof enough,
   where no tension falls in return, which ends at zero.
   `dtau` has the links of this rank: what is not of a rigid link, or grows less, or not the way that the law admits, proves nothing and becomes zero.
   Collective on structure
*/
PetscErrorCode LatinEquilibriumFarkas_Private(LatinStructure structure, Vec u, PetscBool claims, PetscBool stays, PetscReal dtau[], LatinEquilibrium *found)
{
  PetscReal sum[2] = {0.0, 0.0}, most[2] = {0.0, 0.0}, size, prescribed, moved, left, *x; /* the work on gaps and prescribed displacements, and of each by itself; what grows, and what is let go */
  PetscInt  mine[LATIN_LISTED], count    = 0;
  Vec       forces;

  PetscFunctionBegin;
  PetscCall(DMGetGlobalVector(structure->dm, &forces));
  PetscCall(DMGetWorkArray(structure->dm, structure->links_local, MPIU_REAL, &x));
  PetscCall(VecZeroEntries(forces));
  PetscCall(LatinStructureStrains_Private(structure, forces, x)); /* what is prescribed, and nothing else */
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscReal sign = LatinLawSign(structure->law[l]), grows = LatinLaws[structure->law[l]].rigid ? sign * dtau[l] : 0.0;

    dtau[l] = sign * PetscMax(0.0, grows);
    sum[0] += dtau[l] * x[l];
    sum[1] += PetscAbsReal(dtau[l] * x[l]);
    most[0] = PetscMax(most[0], grows);
    most[1] = PetscMax(most[1], -grows);
  }
  PetscCall(LatinStructureForces_Private(structure, dtau, u, NULL, forces));
  PetscCall(VecNorm(forces, NORM_2, &left));
  PetscCall(VecNorm(u, NORM_2, &moved));
  PetscCall(DMRestoreWorkArray(structure->dm, structure->links_local, MPIU_REAL, &x));
  PetscCall(DMRestoreGlobalVector(structure->dm, &forces));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, most, 2, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)structure)));
  PetscCall(LatinStructureSize_Private(structure, &size, &prescribed));
  if (claims && moved > 0.0) size = 0.0;
  if (stays && most[1] <= PETSC_SQRT_MACHINE_EPSILON * most[0]) left = 0.0;
  if (!(sum[0] > PetscMax(LATIN_JAM_FAR * moved, size) * left + PETSC_SQRT_MACHINE_EPSILON * sum[1])) PetscFunctionReturn(0);
  for (PetscInt l = 0; l < structure->links_local; l++) {
    if (PetscAbsReal(dtau[l]) < LATIN_UNHELD * most[0]) continue;
    if (count < LATIN_LISTED) mine[count] = structure->links_start + l;
    count++;
  }
  PetscCall(LatinList_Private(PetscObjectComm((PetscObject)structure), count, mine, &found->links, found->link));
  if (found->links) found->verdict = LATIN_JAMMED;
  PetscFunctionReturn(0);
}

/*
   Damped stages from the start show whether rigid links are jammed: the verdict is LATIN_JAMMED then, else *found stays.
   z and work are of the length of a state. Displacements in the subdomains are lost, tensions of links stay. Collective on latin
*/
PetscErrorCode LatinEquilibriumJammed_Private(Latin latin, Vec z, Vec work, LatinEquilibrium *found)
{
  LatinStructure structure    = latin->sub.structure;
  const PetscInt applications = latin->linear.applications;
  PetscReal     *before, *dtau;
  Vec            u;

  PetscFunctionBegin;
  if (structure->rigid_law < 0 || structure->rubs || structure->ground) PetscFunctionReturn(0); /* rigid links of a time step have no gaps, or do not bear */
  PetscCall(PetscMalloc2(structure->links_local, &before, structure->links_local, &dtau));
  PetscCall(PetscArraycpy(before, latin->linear.rigid_tension, structure->links_local));
  PetscCall(LatinInitialState_Private(&latin->linear, z));
  for (PetscInt k = 0; k < LATIN_JAM_STAGES && !latin->linear.failed; k++) {
    if (k == LATIN_JAM_STAGES - 1) {
      PetscCall(LatinReturnTensions_Private(&latin->linear));
      PetscCall(PetscArraycpy(dtau, latin->linear.rigid_tension, structure->links_local));
    }
    PetscCall(LatinApply_Private(&latin->linear, z, work));
    PetscCall(VecAXPBY(z, 0.5, 0.5, work)); /* damped, or tensions would only swing */
  }
  PetscCall(DMGetGlobalVector(structure->dm, &u));
  PetscCall(LatinAverage_Private(&latin->linear, u));
  PetscCall(LatinReturnTensions_Private(&latin->linear));
  for (PetscInt l = 0; l < structure->links_local; l++) dtau[l] = latin->linear.rigid_tension[l] - dtau[l];
  if (!latin->linear.failed) PetscCall(LatinEquilibriumFarkas_Private(structure, u, PETSC_FALSE, PETSC_FALSE, dtau, found));
  PetscCall(DMRestoreGlobalVector(structure->dm, &u));
  PetscCall(PetscArraycpy(latin->linear.rigid_tension, before, structure->links_local));
  PetscCall(PetscFree2(before, dtau));
  latin->linear.applications = applications;
  PetscFunctionReturn(0);
}
