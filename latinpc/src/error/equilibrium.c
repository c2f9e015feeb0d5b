#include "error/latinerror.h"

/*
   Verdict on displacements u: whether they are an equilibrium. Small steps of the iteration prove little. The state may creep: at a node whose load
   is small beside the search directions of its slack links, or with rigid links whose tensions grow without bound; and a structure without
   equilibrium moves more and more slowly relative to its displacements. The unbalance r = B^t tau(u) - F (error/nodalbalance.c) bounds the error:

   - row sums: with D the row sums of the stiffness, K <= D, so the energy error is at least |D^-1/2 r|, the l2 error about |D^-1 r|;
   - nearly straight links: the node between them is far softer along its displacement than D, and r moves it further. Rounding of the directions of
     tensions does so as well if prestress holds the node: reported as `blur`, not as an error;
   - masses: in a motion masses alone may hold the structure, and M / h^2 is soft relative to links. For the translations t of all free displacements,
     and for t = u, t.r = t.K e with the error e, so that |e| >= |t.r| / |K t|;
   - gaps: a closed rigid link that misses its gap by g has an error of u of at least g / sqrt(2);
   - rest: a motion that comes to rest has no displacements as a measure. Masses only stiffen the nodes, so D^-1 bounds the displacements due to
     rounding of r. If these exceed the target error of u in the norm of D, where light nodes count by their weight, and in the l2 norm, and that of
     missed gaps, the step is accurate to rounding (`at_rest`). Masses that no link holds are softer than D: elastic structures are at rest as well if
     inertia and tensions of u are rounding of the forces, to the target error, and r is at each node. Light nodes may still move beside heavy ones,
     whose rounding hides that. Nothing moves (`still`) if rounding of r at each node displaces it as much, by its own row sums, or if it moves by less
     than rounding of coordinates, as free nodes do that have come to rest;
   - self-stress: tensions of closed loops of rigid links are arbitrary, and an accelerated iteration may make them so large that their rounding hides all
     other forces. In a motion such a state proves nothing, as its unbalance is rounding at any displacement;
   - unheld nodes: if the unbalance is as large as the forces at the node, nothing holds it. It moves until a link resists;
   - work: r.u = 0 at an equilibrium; along a mechanism only loads do work. r.u is compared with the work of tensions and loads, independent of units
     and stiffnesses.
*/

#define LATIN_FORCE_NOISE  8.0  /* times eps and the forces at a node: rounding of their sum */
#define LATIN_FORCE_FACTOR 10.0 /* safety factor on the error by row sums; with it that error is at most 0.06 of a reached target, on structures of all kinds */
/* a node is unheld if its unbalance exceeds this part of its forces; nodes are listed if they move by more than this part of the largest motion */
#define LATIN_UNHELD       0.5
#define LATIN_WORK_LEFT    0.5                          /* largest r.u of an equilibrium, relative to the works: 0 at solutions, 1 in free fall */
#define LATIN_WORK_CANCELS 0.03                         /* weight of absolute works of links and loads in these works: a self-stress leaves rounding */
#define LATIN_GAP_NONE     1e3                          /* times eps and tau / l: displacements of links without gaps that count as zero */
#define LATIN_POINT        64.0                         /* times eps and the size of the structure: displacements below the rounding of coordinates */
#define LATIN_GAP_POINT    4.0                          /* the same for gaps and prescribed displacements */
#define LATIN_SOFT         LatinByPrecision(1e-7, 1e-4) /* stiffness of a mechanism, relative to that of the softest link */
#define LATIN_PUSH         1e-9                         /* rounding of the loads along a step, relative to the loads */
#define LATIN_LOAD_LEFT    0.1                          /* least part of the loads along a mechanism that tensions do not balance */

/* Sums over nodes */
typedef struct {
  PetscReal error;                        /* squared error by row sums, in the norm of the estimate */
  PetscReal work, pushed, loads;          /* r.u; works of loads and springs to the ground: their sum, sum of absolute values */
  PetscReal hidden;                       /* squared rounding of r */
  PetscReal stress;                       /* squared rounding of the self-stress of rigid links at nodes */
  PetscReal left, all, load, bearing;     /* squares of r beyond rounding, of r, of the loads, of the tensions at nodes */
  PetscReal moved[4], stiff[4], noise[4]; /* t.r, squares of K t, rounding of t.r: translations, then u */
  PetscReal along, blur;                  /* squared errors of nodes along their displacements: by r, by rounded directions of tensions */
  PetscReal shown;                        /* number of components of r beyond LATIN_FORCE_FACTOR times rounding */
  PetscReal u[2], hides[2];               /* squares of u, and of D^-1 times the rounding of r, in the norm of D and the l2 norm */
  PetscReal moves;                        /* number of components that move farther than D^-1 times the rounding of r there, and than `point` */
} LatinNodalSums;

/* Computes size, the diagonal of the bounding box of the nodes, and the largest prescribed displacement (or NULL). Collective on structure */
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
  *size = PetscSqrtReal(sum);
  if (prescribed) *prescribed = most[6];
  PetscFunctionReturn(0);
}

/* Computes the l2 norm of displacements below the rounding of coordinates; in a motion, of the initial strains of the step. Collective on structure */
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

/*
   Finds whether u is larger than the structure, the prescribed displacements and all gaps together. Few solutions are, in a theory of
   small displacements; only these need a proof. Collective on structure
*/
PetscErrorCode LatinEquilibriumFar_Private(LatinStructure structure, Vec u, PetscBool *far)
{
  PetscReal size, prescribed, most, gaps = 0.0;

  PetscFunctionBegin;
  PetscCall(LatinStructureSize_Private(structure, &size, &prescribed));
  for (PetscInt l = 0; l < structure->links_local; l++)
    if (LatinLaws[structure->law[l]].rigid) gaps += PetscAbsReal(structure->e0[l]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &gaps, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  PetscCall(VecNorm(u, NORM_INFINITY, &most));
  *far = (PetscBool)(most > PetscMax(size, PetscMax(prescribed, gaps)));
  PetscFunctionReturn(0);
}

/* Lists nodes or links. total: count on all ranks; list: the LATIN_LISTED lowest numbers, from `mine` of each rank. Collective on comm */
PetscErrorCode LatinList_Private(MPI_Comm comm, PetscInt count, PetscInt mine[], PetscInt *total, PetscInt list[])
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

/* Unheld nodes */
typedef struct {
  PetscInt  count, least[LATIN_LISTED]; /* number on this rank; lowest global numbers */
  PetscInt  more[2];                    /* number of those that no link stops, and of those with a load below rounding */
  PetscReal sum;                        /* squared distances to where links stop them */
  PetscReal rounding[2];                /* rounding of the largest load, below which loads count as zero; of the largest displacement */
} LatinUnheld;

/* Adds a node to `unheld` if nothing holds it and a load moves it */
static void LatinUnheldNode(const LatinNode *at, PetscInt dim, PetscInt number, LatinUnheld *unheld)
{
  PetscReal push = 0.0, load = 0.0, noise = PetscMax(LATIN_FORCE_NOISE * PETSC_MACHINE_EPSILON * at->gaps, unheld->rounding[0]);
  PetscBool mass = PETSC_FALSE;
  PetscInt  last;

  for (PetscInt c = 0; c < dim; c++) {
    push += PetscSqr(at->r[c]);
    load += PetscSqr(at->load[c]);
    noise = PetscMax(noise, at->stiffness[c] * unheld->rounding[1]);
    if (at->ground[c] > 0.0) mass = PETSC_TRUE;
  }
  push = PetscSqrtReal(push);
  if (mass || push <= LATIN_UNHELD * (at->tension + PetscSqrtReal(load))) return;
  if (push <= noise) {
    if (PetscSqrtReal(load) <= unheld->rounding[0]) return;
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

/* Reduces the unheld nodes over all ranks to *found. Collective on comm */
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

/* Adds component c of a node. rounding: that of the largest displacement; point: that of coordinates */
static void LatinSumComponent(const LatinNode *at, PetscInt dim, PetscInt c, PetscBool energy, PetscReal rounding, PetscReal point, LatinNodalSums *sum)
{
  const PetscReal ground = at->ground[c], noise = LATIN_FORCE_NOISE * PETSC_MACHINE_EPSILON * at->rounding[c];
  const PetscReal stiff = at->stiffness[c] + ground, left = PetscMax(0.0, PetscAbsReal(at->r[c]) - noise), pushed = (ground * at->u[c] - at->load[c]) * at->u[c];

  sum->left += left * left;
  sum->hidden += noise * noise;
  sum->stress += c ? 0.0 : PetscSqr(LATIN_FORCE_NOISE * PETSC_MACHINE_EPSILON * (at->tension - at->bearing));
  sum->all += PetscSqr(at->r[c]);
  sum->shown += PetscAbsReal(at->r[c]) > LATIN_FORCE_FACTOR * noise ? 1.0 : 0.0;
  sum->load += PetscSqr(at->load[c]);
  sum->bearing += c ? 0.0 : PetscSqr(PetscMax(at->bearing, rounding * at->stiffness[c])); /* at least rounding, as no link may bear */
  if (stiff > 0.0) {
    sum->error += energy ? left * left / stiff : PetscSqr(left / stiff);
    sum->hides[0] += noise * noise / stiff;
    sum->hides[1] += PetscSqr(noise / stiff);
  }
  sum->u[0] += stiff * PetscSqr(at->u[c]);
  sum->u[1] += PetscSqr(at->u[c]);
  sum->moves += stiff * PetscAbsReal(at->u[c]) > noise && PetscAbsReal(at->u[c]) > point ? 1.0 : 0.0;
  sum->work += at->r[c] * at->u[c];
  sum->pushed += pushed;
  sum->loads += ground * at->u[c] * at->u[c] + PetscAbsReal(at->load[c] * at->u[c]); /* both cancel at a mass in flight */
  sum->moved[c] += at->r[c];
  sum->noise[c] += noise;
  for (PetscInt d = 0; d < dim; d++) sum->stiff[d] += PetscSqr(at->translation[3 * d + c] + (c == d ? ground : 0.0));
  sum->moved[3] += at->r[c] * at->u[c];
  sum->noise[3] += noise * PetscAbsReal(at->u[c]);
  sum->stiff[3] += PetscSqr(at->tangent[c] + ground * PetscAbsReal(at->u[c]));
}

/*
   Adds the error of a node along its displacement: the unbalance beyond rounding over the stiffness of its taut links, unless a link of uncertain
   state blocks that way. Between nearly straight links a node is softer than its row sums by orders of magnitude
*/
static void LatinSumNode(const LatinNode *at, PetscInt dim, PetscBool energy, LatinNodalSums *sum)
{
  PetscReal held = at->held, push = at->slack, size = 0.0;

  for (PetscInt c = 0; c < dim; c++) {
    held += at->ground[c] * PetscSqr(at->u[c]);
    push += at->r[c] * at->u[c];
    size += PetscSqr(at->u[c]);
  }
  if (!(held > 0.0) || at->closed[push > 0.0 ? 1 : 0] > 0.0) return; /* -r moves the node */
  push = PetscMax(0.0, PetscAbsReal(push) - at->hides);
  sum->along += (energy ? held : size) * PetscSqr(PetscMin(1.0, push / held));
  sum->blur += (energy ? held : size) * PetscSqr(PetscMin(1.0, 0.5 * PETSC_MACHINE_EPSILON * at->turns / held));
}

/* What a check sums up */
typedef struct {
  PetscInt          dim;
  PetscBool         energy; /* errors in the energy norm, not the l2 norm */
  PetscReal         point;  /* rounding of coordinates */
  LatinNodalSums    sum;    /* over nodes */
  LatinNodalBalance links;  /* over links */
  LatinUnheld       unheld;
} LatinNodalJudge;

static void LatinNodeJudge(const LatinNode *at, PetscInt number, void *ctx)
{
  LatinNodalJudge *judge = (LatinNodalJudge *)ctx;

  for (PetscInt c = 0; c < judge->dim; c++) LatinSumComponent(at, judge->dim, c, judge->energy, judge->unheld.rounding[1], judge->point, &judge->sum);
  LatinSumNode(at, judge->dim, judge->energy, &judge->sum);
  LatinUnheldNode(at, judge->dim, number, &judge->unheld);
}

/*
   Computes the greatest distance by which rigid links miss their gaps; 0 if displacements are rounding, and the gaps or the distances as well. norm:
   l2 norm of u; still: a motion at rest. Collective
*/
static PetscErrorCode LatinGapError_Private(const LatinNodalBalance *balance, Vec u, PetscReal norm, PetscReal target, PetscBool still, PetscReal *missed)
{
  const LatinStructure structure = balance->latin->sub.structure;
  PetscReal            size, prescribed, most;
  PetscBool            moves, gaps;

  PetscFunctionBegin;
  *missed = 0.0;
  if (structure->rigid_law < 0) PetscFunctionReturn(0);
  PetscCall(LatinStructureSize_Private(structure, &size, &prescribed));
  size *= PETSC_MACHINE_EPSILON;
  /* coordinates and gaps are no numbers of a time step, but its displacements. If supports alone jam links, unbounded tensions hide the distance */
  if (structure->ground) {
    if (!still || (prescribed > LATIN_GAP_POINT * size && balance->gap > target * prescribed)) *missed = balance->gap;
    PetscFunctionReturn(0);
  }
  PetscCall(VecNorm(u, NORM_INFINITY, &most));
  moves = (PetscBool)(norm > LATIN_GAP_NONE * PETSC_MACHINE_EPSILON * PetscSqrtReal(balance->sum.bearing_moves) && most > LATIN_POINT * size);
  gaps  = (PetscBool)(PetscSqrtReal(balance->sum.bearing_gaps) > LATIN_GAP_POINT * size || prescribed > LATIN_GAP_POINT * size);
  if (moves || (gaps && balance->gap > LATIN_GAP_POINT * size)) *missed = balance->gap;
  PetscFunctionReturn(0);
}

/* Computes the sums of a check over nodes and links, on all ranks, and lists the unheld nodes in *found. Collective on structure */
static PetscErrorCode LatinJudgeSums_Private(Latin latin, Vec u, Vec r, Vec more, PetscReal target, LatinNodalJudge *judge, LatinEquilibrium *found)
{
  const LatinStructure structure = latin->sub.structure;
  PetscReal            largest = 0.0, *rounding = judge->unheld.rounding;

  PetscFunctionBegin;
  PetscCall(VecNorm(structure->load, NORM_INFINITY, &rounding[0]));
  if (more) PetscCall(VecNorm(more, NORM_INFINITY, &largest));
  rounding[0] += largest;
  PetscCall(VecNorm(u, NORM_INFINITY, &rounding[1]));
  PetscCall(LatinStructureSize_Private(structure, &judge->point, NULL));
  judge->point *= PETSC_MACHINE_EPSILON;
  for (PetscInt i = 0; i < 2; i++) rounding[i] *= LATIN_FORCE_NOISE * PETSC_MACHINE_EPSILON;
  PetscCall(LatinNodalBalance_Private(latin, u, r, more, target, LatinNodeJudge, judge, &judge->links));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &judge->sum, sizeof(judge->sum) / sizeof(PetscReal), MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  PetscCall(LatinUnheld_Private(PetscObjectComm((PetscObject)structure), &judge->unheld, found));
  PetscFunctionReturn(0);
}

/* Returns the rounding of the self-stress of rigid links in a motion, relative to the other forces */
static PetscReal LatinJudgeStress(const LatinNodalJudge *judge)
{
  const LatinNodalSums *sum = &judge->sum;

  return judge->links.latin->sub.structure->ground ? PetscSqrtReal(LatinRatio(sum->stress, PetscMax(sum->load, sum->bearing))) : 0.0;
}

/* Whether a motion is at rest: rounding of the forces moves it by more than the target error */
static PetscBool LatinJudgeRests(const LatinNodalJudge *judge, PetscReal target)
{
  const LatinNodalSums *sum = &judge->sum;

  if (!judge->links.latin->sub.structure->ground) return PETSC_FALSE;
  return (PetscBool)(PetscSqr(target) * sum->u[0] <= sum->hides[0] && PetscSqr(target) * sum->u[1] <= sum->hides[1] && 0.5 * PetscSqr(target * judge->links.gap) <= sum->hides[1]);
}

/* Whether an elastic motion is at rest: the forces of its displacements are rounding, and the unbalance is at each node */
static PetscBool LatinJudgeIdles(const LatinNodalJudge *judge, PetscReal target)
{
  const LatinStructure structure = judge->links.latin->sub.structure;

  return (PetscBool)(structure->ground && structure->rigid_law < 0 && judge->sum.shown == 0.0 && PetscSqr(target) * judge->sum.stiff[3] <= judge->sum.hidden);
}

/* Sets the unbalance and its rounding, relative to the loads or the tensions. far: u is larger than the structure. Collective on structure */
static PetscErrorCode LatinJudgeForces_Private(LatinStructure structure, const LatinNodalSums *sum, PetscBool far, LatinEquilibrium *found)
{
  const PetscBool loaded = (PetscBool)(sum->load > 0.0);
  PetscReal       drawn  = 0.0;

  PetscFunctionBegin;
  found->left = PetscSqrtReal(sum->left);
  if (!loaded && far) PetscCall(LatinStructureDrawn_Private(structure, &drawn));
  /* after a motion due to tensions as drawn none may be left */
  if (loaded || far) found->rounding = PetscSqrtReal(LatinRatio(sum->hidden, loaded ? sum->load : PetscMax(sum->bearing, PetscSqr(drawn))));
  if (sum->left > 0.0) found->unbalance = PetscSqrtReal(LatinRatio(sum->left, loaded ? sum->load : sum->bearing));
  if (sum->left > 0.0 || loaded) found->forces = PetscSqrtReal(LatinRatio(sum->all, PetscMax(sum->bearing, sum->load)));
  PetscFunctionReturn(0);
}

/* Sets the relative errors that the unbalance shows: error, blur. size: l2 norm of u */
static void LatinJudgeError(const LatinNodalJudge *judge, PetscReal size, LatinEquilibrium *found)
{
  const LatinNodalSums *sum  = &judge->sum;
  const PetscReal       norm = judge->energy ? PetscSqrtReal(judge->links.sum.energy) : size;

  if (!(norm > 0.0)) return;
  found->error = PetscMax(LATIN_FORCE_FACTOR * PetscSqrtReal(sum->error), PetscSqrtReal(sum->along)) / norm;
  found->blur  = PetscSqrtReal(sum->blur) / norm;
  if (!judge->links.latin->sub.structure->ground || judge->energy) return;
  for (PetscInt d = 0; d < 4; d++)
    if (sum->stiff[d] > 0.0) found->error = PetscMax(found->error, (PetscAbsReal(sum->moved[d]) - sum->noise[d]) / (PetscSqrtReal(sum->stiff[d]) * norm));
}

/*
   Judges displacements u with the unbalance r: whether they are an equilibrium to a relative error of `target`, in the energy or the l2 norm. more:
   an additional load, or NULL; rests: the iteration stagnates at rounding; strict: missed gaps count in a motion at rest, unless nothing moves.
   Collective on structure
*/
PetscErrorCode LatinEquilibriumCheck_Private(Latin latin, Vec u, Vec r, Vec more, PetscReal target, PetscBool energy, PetscBool rests, PetscBool strict, LatinEquilibrium *found)
{
  const LatinStructure structure = latin->sub.structure;
  LatinNodalJudge      judge     = {.dim = structure->dim, .energy = energy};
  LatinNodalSums      *sum       = &judge.sum;
  PetscReal            size, missed, stress, works;
  PetscBool            far, idles;

  PetscFunctionBegin;
  PetscCall(PetscMemzero(found, sizeof(*found)));
  PetscCall(LatinJudgeSums_Private(latin, u, r, more, target, &judge, found));
  PetscCall(VecNorm(u, NORM_2, &size));
  idles          = LatinJudgeIdles(&judge, target);
  found->at_rest = (PetscBool)(idles || LatinJudgeRests(&judge, target));
  found->still   = (PetscBool)(found->at_rest && sum->moves == 0.0);
  PetscCall(LatinGapError_Private(&judge.links, u, size, target, strict ? found->still : found->at_rest, &missed));
  PetscCall(LatinEquilibriumFar_Private(structure, u, &far));
  /* the unbalance moves it by less than rounding */
  if (idles || (found->at_rest && PetscSqr(LATIN_FORCE_FACTOR) * sum->error <= sum->hides[energy ? 0 : 1])) sum->error = 0.0;
  found->balanced = (PetscBool)(sum->error == 0.0);
  PetscCall(LatinJudgeForces_Private(structure, sum, far, found));
  if (!idles) LatinJudgeError(&judge, size, found);
  missed = PetscMax(missed / PETSC_SQRT2, found->distance);
  if (missed > 0.0) missed = missed < size ? missed / size : 1.0;
  stress        = LatinJudgeStress(&judge);
  found->error  = PetscMax(PetscMax(found->error, missed), stress);
  found->missed = missed;
  PetscCall(PetscInfo(structure, "Unbalance %g of the loads, rounded by at most %g; gaps missed by %g of the displacements\n", (double)found->unbalance, (double)found->rounding, (double)missed));

  /* the work of the tensions is r.u minus that of the loads */
  works = PetscAbsReal(sum->work - sum->pushed) + PetscAbsReal(sum->pushed) + LATIN_WORK_CANCELS * (judge.links.sum.work + sum->loads);
  if (far && (sum->load > 0.0 || !found->balanced) && PetscAbsReal(sum->work) > LATIN_WORK_LEFT * works) {
    found->verdict = LATIN_UNBOUNDED;
    PetscCall(PetscInfo(structure, "Displacements larger than the structure: %g of the work of tensions and loads is not balanced\n", (double)(PetscAbsReal(sum->work) / works)));
  } else if (found->error <= target) found->verdict = LATIN_EQUILIBRIUM;
  else found->verdict = (rests && PetscMax(missed, stress) > target) || (found->hidden && missed > target) ? LATIN_BELOW_ROUNDING : LATIN_NOT_YET;
  PetscFunctionReturn(0);
}

/* Sets the verdict LATIN_UNBOUNDED and lists the nodes that `step` moves most. Collective on structure */
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
    if (!(size > 0.0) || size < LATIN_UNHELD * most) continue; /* clamped nodes, also if `most` is 0 */
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
   Tests whether a Newton step is a mechanism: no link resists it at any amplitude, and the loads do work on it. Then the energy is unbounded below,
   and the verdict is LATIN_UNBOUNDED, with the nodes that move; else *found is unchanged. A link that resists once its gap has closed, or that bears
   the loads before it yields, is not part of a mechanism. r: unbalance after the step. Collective on structure
*/
PetscErrorCode LatinEquilibriumMechanism_Private(LatinStructure structure, Vec step, Vec r, Vec more, LatinEquilibrium *found)
{
  PetscReal   length, least, resisted, borne, load, beside = 0.0;
  PetscScalar pushed, other = 0.0, left;

  PetscFunctionBegin;
  PetscCall(VecNorm(step, NORM_2, &length));
  if (!(length > 0.0) || PetscIsInfOrNanReal(length)) PetscFunctionReturn(0);
  PetscCall(LatinStructureStiffnessRange_Private(structure, &least, NULL));
  PetscCall(LatinStructureResistFar_Private(structure, step, &resisted, &borne));
  PetscCall(VecDot(structure->load, step, &pushed));
  if (more) PetscCall(VecDot(more, step, &other));
  PetscCall(VecDot(r, step, &left));
  PetscCall(VecNorm(structure->load, NORM_2, &load));
  if (more) PetscCall(VecNorm(more, NORM_2, &beside));
  if (resisted > LATIN_SOFT * least * length * length || PetscAbsScalar(left) <= LATIN_LOAD_LEFT * PetscAbsScalar(pushed + other)) PetscFunctionReturn(0);
  /* -step is the motion; an unheld node without load moves by rounding only */
  if (-PetscRealPart(pushed + other) <= LATIN_PUSH * (load + beside) * length) PetscFunctionReturn(0);
  /* links that will yield bear the loads before */
  if (-PetscRealPart(pushed + other) - borne <= -LATIN_LOAD_LEFT * PetscRealPart(pushed + other)) PetscFunctionReturn(0);
  PetscCall(LatinEquilibriumMoved_Private(structure, step, found));
  PetscFunctionReturn(0);
}
