#include "structure/structureimpl.h"
#include "structure/turned.h"
#include "structure/turning.h"

/*
   The frame: a structure with fixed directions that represents rotating links. Each link of the original becomes dim parts between the same nodes, with
   orthogonal directions, first along the link, then across it. So operators, subdomains and interfaces are those of any structure; only the local stage
   differs (stages/localturning.c).

   prestress  The part along the link has its law; those across it are bars of the stiffness t0 / l. The frame is the exact problem.
   large      The parts are the components of a search direction E = k n n^t + c (1 - n n^t) of the link, whose law couples them.

   The search direction is computed at a configuration u, at first as drawn. A taut link gets its tangent: k of its law and c = tau / R; as drawn, a
   larger c, since tensions grow with the displacements. A slack cable has no stiffness, and one that slackens or tightens any mean stiffness from zero
   to k. Such cables must follow the displacements of the taut links: they get LATIN_FRAME_SLACK times the mean c of these. In a time step the tangent is
   that of the mean force (structure/midpoint.h), which covers cables that slacken in the step.

   An inextensible cable is a cable in the frame, with a penalty stiffness p and a strain larger by lambda / p: its tension is max(0, lambda + p x)
   (snes/largerigid.c). A contact is its mirror image. A link with a fixed direction has no force across it: c is only a floor.

   Constants: stages are linear stages of a solve; saddles are nets with tensions of 1e-4 to 1e-2 of the stiffness. "Mean" is the mean tau / R of the
   taut links at u.
*/

#define LATIN_FRAME_FIRST   4.0   /* factor on tau / R for c as drawn; nets that sag by 7 to 15 % of their span take 11 to 16 stages, with 1 or 16 up to 26 */
#define LATIN_FRAME_LEAST   0.3   /* least c, relative to the mean; 0.1 to 0.3 make no difference, with 0.03 seven saddles take a tenth more stages */
#define LATIN_FRAME_SLACK   2.0   /* k of slack and nearly slack cables, relative to the mean; with 7 the saddles take a quarter more stages, with 1 a tenth */
#define LATIN_FRAME_NEAR    0.1   /* largest tau / R of a nearly slack cable, relative to the mean; with 0.02 three times as many stages, with 0.3 a few more */
#define LATIN_FRAME_FLOOR   1e-6  /* least k and c in the tangent stiffness, relative to the mean; 1e-2 and 1e-4 make no difference */
#define LATIN_FRAME_STRUT   2.0   /* least c of a link in compression, relative to -tau / R; with 1 its length is not unique in the local stage */
#define LATIN_FRAME_NONE    1e-3  /* replaces the mean if no link is taut, relative to the mean stiffness */
#define LATIN_FRAME_PENALTY 100.0 /* initial penalty of a rigid link, relative to its automatic search parameter (structure/rigidlaws.c) */
#define LATIN_FRAME_LOWEST  1e-5  /* least value of the mean, relative to the mean stiffness: operators must not be singular if tensions vanish */

/* Computes axes, [dim][dim], an orthonormal basis whose first vector is n */
static void LatinFrameAxes(PetscInt dim, const PetscReal n[], PetscReal axes[])
{
  PetscInt least = 0;

  for (PetscInt c = 0; c < dim; c++) axes[c] = n[c];
  if (dim == 2) {
    axes[2] = -n[1];
    axes[3] = n[0];
  }
  if (dim < 3) return;
  for (PetscInt c = 1; c < 3; c++)
    if (PetscAbsReal(n[c]) < PetscAbsReal(n[least])) least = c;
  for (PetscInt c = 0; c < 3; c++) axes[3 + c] = (c == least ? 1.0 : 0.0) - n[least] * n[c];
  (void)LatinUnitVector(3, axes + 3, axes + 3);
  for (PetscInt c = 0; c < 3; c++) axes[6 + c] = n[(c + 1) % 3] * axes[3 + (c + 2) % 3] - n[(c + 2) % 3] * axes[3 + (c + 1) % 3];
}

/* Stiffness, law, and shift of the strain of link l of the original, in which rigid links are springs: p, cable or compression only, lambda / p */
static PetscReal LatinFrameStiffness(LatinStructure frame, PetscInt l)
{
  return LatinLaws[frame->original->law[l]].rigid ? frame->spring[l] : frame->original->stiffness[l];
}

static PetscInt LatinFrameLaw(LatinStructure frame, PetscInt l)
{
  const PetscInt law = frame->original->law[l];

  return LatinLaws[law].rigid ? law == LATIN_LAW_CONTACT ? LATIN_LAW_COMPRESSION_ONLY : LATIN_LAW_CABLE : law;
}

static PetscReal LatinFrameShift(LatinStructure frame, PetscInt l)
{
  return LatinLaws[frame->original->law[l]].rigid ? frame->spring[frame->original->links_local + l] / frame->spring[l] : 0.0;
}

/* Computes the parts of all links, geometry prestress */
static void LatinFramePrestress(LatinStructure frame)
{
  const LatinStructure original = frame->original;
  const PetscInt       dim      = original->dim;

  for (PetscInt l = 0; l < original->links_local; l++) {
    const LatinLaw *law    = &LatinLaws[original->law[l]];
    PetscReal       length = 0.0;

    for (PetscInt c = 0; c < dim; c++) length += PetscSqr(original->span[dim * l + c]);
    LatinFrameAxes(dim, original->direction + dim * l, frame->direction + dim * dim * l);
    for (PetscInt c = 0; c < dim; c++) {
      frame->law[dim * l + c]       = c ? LATIN_LAW_BAR : original->law[l];
      frame->stiffness[dim * l + c] = c ? law->tension(original->stiffness[l], original->e0[l], law->ctx) / PetscSqrtReal(length) : original->stiffness[l];
      frame->e0[dim * l + c]        = c ? 0.0 : original->e0[l];
    }
  }
}

/* Sums over the links of all ranks, for the search direction */
typedef struct {
  PetscReal taut, across; /* number of taut links, sum of their tau / R */
  PetscReal all, stiff;   /* number of links, sum of their stiffnesses */
} LatinFrameSums;

/* One link, for its search direction */
typedef struct {
  PetscReal k, across; /* tangent stiffness; tension over length, 0 with a fixed direction */
  PetscBool loaded;    /* whether it bears a force at its strain */
} LatinFrameLink;

/* Computes the tangent stiffness (k, c) of link l. Slack cables get a small positive one. In compression c < 0, but not if firm, nor in time steps */
static void LatinFrameTangent(LatinStructure frame, PetscInt l, const LatinFrameLink *link, PetscBool firm, PetscReal mean, PetscReal *k, PetscReal *c)
{
  const PetscReal floor = LATIN_FRAME_FLOOR * mean, least = PetscMax(frame->original->ahead && !frame->original->slope ? frame->original->hold * mean : 0.0, floor);

  *k = PetscMax(link->k, least);
  if (LatinStructureKeeps(frame->original, l)) *c = floor;
  else if (link->k > 0.0 && link->across < 0.0) *c = firm || frame->original->midpoint ? floor : link->across;
  else *c = PetscMax(least, link->across);
}

/* Returns the mean tau / R of the taut links, at least a small part of the mean stiffness */
static PetscReal LatinFrameTension(const LatinFrameSums *sum)
{
  const PetscReal mean = sum->taut > 0.0 ? sum->across / sum->taut : LATIN_FRAME_NONE * sum->stiff / sum->all;

  return PetscMax(mean, LATIN_FRAME_LOWEST * sum->stiff / sum->all);
}

/* Computes the search direction (k, c) of link l */
static void LatinFrameDirection(LatinStructure frame, PetscInt l, const LatinFrameLink *link, LatinFrameType type, const LatinFrameSums *sum, PetscReal *k, PetscReal *c)
{
  const PetscReal mean = LatinFrameTension(sum), whole = LatinFrameStiffness(frame, l), low = PetscMin(LATIN_FRAME_SLACK * mean, whole);
  const PetscBool drawn = (PetscBool)(type == LATIN_FRAME_DRAWN);
  PetscReal       across;

  if (type >= LATIN_FRAME_TANGENT) {
    LatinFrameTangent(frame, l, link, (PetscBool)(type == LATIN_FRAME_FIRM), mean, k, c);
    return;
  }
  *k = frame->original->midpoint ? PetscMax(link->k, low) : whole;
  *c = LATIN_FRAME_FLOOR * mean;
  if (LatinStructureKeeps(frame->original, l)) {
    if (!link->loaded) *k = low;
    return;
  }
  if (!drawn && LatinFrameLaw(frame, l) == LATIN_LAW_CABLE && link->across <= LATIN_FRAME_NEAR * mean) *k = low; /* slack, or nearly */
  if (link->across > 0.0) across = drawn ? LATIN_FRAME_FIRST * link->across : link->across;
  else across = -LATIN_FRAME_STRUT * link->across;
  *c = PetscMin(*k, PetscMax(LATIN_FRAME_LEAST * mean, across));
}

/* Computes data of the links of the original, link[links_local], their bases, frame->direction, and sums, at vertex displacements a; NULL: as drawn. Collective on frame */
static PetscErrorCode LatinFrameMeasure_Private(LatinStructure frame, const PetscScalar a[], LatinFrameLink link[], LatinFrameSums *sum)
{
  const LatinStructure original = frame->original;
  const PetscInt       dim      = original->dim;

  PetscFunctionBegin;
  PetscCall(PetscMemzero(sum, sizeof(*sum)));
  for (PetscInt l = 0; l < original->links_local; l++) {
    const LatinLaw *law   = &LatinLaws[LatinFrameLaw(frame, l)];
    const PetscBool keeps = LatinStructureKeeps(original, l);
    const PetscReal k = LatinFrameStiffness(frame, l), shift = LatinFrameShift(frame, l);
    PetscReal       r[3] = {0.0, 0.0, 0.0}, n[3], length = 0.0, size = 0.0, x, tension;

    for (PetscInt c = 0; c < dim; c++) {
      r[c] = original->span[dim * l + c] + (a ? PetscRealPart(a[dim * original->ends[2 * l + 1] + c] - a[dim * original->ends[2 * l] + c]) : 0.0);
      length += PetscSqr(original->span[dim * l + c]);
      size += PetscSqr(r[c]);
    }
    size = PetscSqrtReal(size);
    x    = original->e0[l] + shift + (!keeps ? size - PetscSqrtReal(length) : a ? LatinStructureElongation(original, l, a) : 0.0);
    if (keeps || !LatinUnitVector(dim, r, n)) PetscCall(PetscArraycpy(n, original->direction + dim * l, dim));
    LatinFrameAxes(dim, n, frame->direction + dim * dim * l);
    tension        = law->tension(k, x, law->ctx);
    link[l].k      = original->slope ? original->slope[l] : law->tangent(k, original->strain ? original->strain[l] + shift : x, law->ctx);
    link[l].across = !keeps && size > 0.0 ? tension / size : 0.0;
    link[l].loaded = (PetscBool)(tension != 0.0);
    sum->all += 1.0;
    if (!keeps) sum->stiff += k;
    if (link[l].across > 0.0) {
      sum->taut += 1.0;
      sum->across += link[l].across;
    }
    link[l].across = LatinTurnedAcross(original, l, size, link[l].k, link[l].across);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, sizeof(*sum) / sizeof(PetscReal), MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)original)));
  PetscFunctionReturn(0);
}

/* Computes natural lengths and initial elongations of the parts; no operator depends on them */
static void LatinFrameLengths(LatinStructure frame)
{
  const LatinStructure original = frame->original;
  const PetscInt       dim      = original->dim;

  for (PetscInt i = 0; i < dim * original->links_local; i++) {
    const PetscInt   l    = i / dim;
    const PetscReal *span = original->span + dim * l, *row = frame->direction + dim * i;
    PetscReal        whole = 0.0, length = 0.0, along = 0.0;

    for (PetscInt d = 0; d < dim; d++) {
      whole += row[d] * span[d];
      length += PetscSqr(span[d]);
      along += original->direction[dim * l + d] * span[d];
    }
    length                                           = LatinStructureKeeps(original, l) ? along : PetscSqrtReal(length);
    frame->part[LATIN_PART * i + LATIN_PART_NATURAL] = length - original->e0[l] - LatinFrameShift(frame, l);
    frame->part[LATIN_PART * i + LATIN_PART_KEEPS]   = LatinStructureKeeps(original, l) ? 1.0 : 0.0;
    frame->e0[i]                                     = whole; /* component of r0, so that the strain of a part is that of r */
  }
}

/* Sets *link to the tangent of the mean force of a time step: cables that slacken or tighten in it have a stiffness between zero and k */
static void LatinFrameMean(LatinStructure step, PetscInt l, const PetscScalar a[], LatinFrameLink *link)
{
  LatinTurned turned;

  LatinTurnedLink(step, NULL, l, a, &turned);
  link->k = link->across = turned.across;
  for (PetscInt c = 0; c < step->dim; c++) link->k += turned.n[c] * turned.change[c];
}

/* Computes the parts of all links, geometry large, at vertex displacements a; NULL: as drawn. Collective on frame */
static PetscErrorCode LatinFrameLarge_Private(LatinStructure frame, const PetscScalar a[], LatinFrameType type)
{
  const LatinStructure original = frame->original;
  const PetscInt       dim = original->dim, m = original->links_local;
  PetscReal            most = 0.0;
  LatinFrameLink      *link;
  LatinFrameSums       sum;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(m, &link));
  PetscCall(LatinFrameMeasure_Private(frame, a, link, &sum));
  for (PetscInt l = 0; l < m && original->midpoint && a; l++) LatinFrameMean(original, l, a, link + l);
  for (PetscInt l = 0; l < m; l++) most = PetscMax(most, LatinFrameStiffness(frame, l));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &most, 1, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)frame)));
  frame->made = type;
  for (PetscInt i = 0; i < dim * m; i++) {
    const PetscInt l    = i / dim;
    PetscReal     *part = frame->part + LATIN_PART * i, *row = frame->direction + dim * i, k, c;

    LatinFrameDirection(frame, l, link + l, type, &sum, &k, &c);
    part[LATIN_PART_STIFFNESS] = LatinFrameStiffness(frame, l);
    part[LATIN_PART_SCALE]     = PetscSqrtReal(PetscAbsReal(i % dim ? c : k) / most);
    for (PetscInt d = 0; d < dim; d++) row[d] *= part[LATIN_PART_SCALE];
    frame->law[i]       = LatinFrameLaw(frame, l);
    frame->stiffness[i] = i % dim && c < 0.0 ? -most : most;
  }
  LatinFrameLengths(frame);
  PetscCall(PetscFree(link));
  PetscFunctionReturn(0);
}

/* Counts links whose k in the frame differs from the tangent stiffness of their law at `strain` by more than half their stiffness. Collective on frame */
PetscErrorCode LatinFrameChanged_Private(LatinStructure frame, const PetscReal strain[], PetscInt *changed)
{
  const PetscInt dim = frame->dim;

  PetscFunctionBegin;
  *changed = 0;
  for (PetscInt l = 0; l < frame->original->links_local; l++) {
    const LatinLaw *law = &LatinLaws[LatinFrameLaw(frame, l)];
    const PetscReal k = LatinFrameStiffness(frame, l), made = frame->stiffness[dim * l] * PetscSqr(frame->part[LATIN_PART * dim * l + LATIN_PART_SCALE]);

    if (PetscAbsReal(made - law->tangent(k, strain[l] + LatinFrameShift(frame, l), law->ctx)) > 0.5 * k) ++*changed;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, changed, 1, MPIU_INT, MPI_SUM, PetscObjectComm((PetscObject)frame)));
  PetscFunctionReturn(0);
}

/* Recomputes directions and stiffnesses of the parts at displacements u of the original; NULL: as drawn. Collective on frame */
PetscErrorCode LatinFrameRenew_Private(LatinStructure frame, Vec u, LatinFrameType type)
{
  const LatinStructure original = frame->original;
  const PetscScalar   *a;
  Vec                  local;

  PetscFunctionBegin;
  frame->geometry = LATIN_GEOMETRY_LINEAR; /* of the frame: its parts have fixed directions */
  if (original->geometry == LATIN_GEOMETRY_PRESTRESS) LatinFramePrestress(frame);
  else if (!u) PetscCall(LatinFrameLarge_Private(frame, NULL, type));
  else {
    PetscCall(LatinStructureOpen_Private(original, original->vertex_prescribed, u, &local, &a));
    PetscCall(LatinFrameLarge_Private(frame, a, type));
    PetscCall(LatinStructureClose_Private(original, &local, &a));
  }
  frame->general = (PetscBool)(original->geometry == LATIN_GEOMETRY_PRESTRESS && original->general);
  PetscCall(PetscObjectStateIncrease((PetscObject)frame));
  PetscFunctionReturn(0);
}

/* Recomputes natural lengths after a change of multipliers; none: sets these to zero first. Operators do not change. Logically collective on frame */
PetscErrorCode LatinFrameSprings_Private(LatinStructure frame, PetscBool none)
{
  PetscFunctionBegin;
  if (none) PetscCall(PetscArrayzero(frame->spring + frame->original->links_local, frame->original->links_local));
  LatinFrameLengths(frame);
  frame->e0_state++;
  PetscFunctionReturn(0);
}

/* Creates the springs of rigid links: initial penalties, multipliers zero. Collective on frame */
PetscErrorCode LatinFramePenalty_Private(LatinStructure frame)
{
  const LatinStructure original = frame->original;
  const PetscInt       n        = original->links_local;

  PetscFunctionBegin;
  PetscCall(PetscFree(frame->spring));
  if (original->rigid_law < 0) PetscFunctionReturn(0);
  PetscCall(PetscCalloc1(2 * n + 1, &frame->spring)); /* + 1: not NULL on a rank without links */
  PetscCall(LatinStructureStiffness_Private(original, 0.0, frame->spring));
  for (PetscInt l = 0; l < n; l++) frame->spring[l] *= LATIN_FRAME_PENALTY;
  PetscFunctionReturn(0);
}

/* Updates the frame after changes of the original: laws and initial elongations rebuild the parts, loads do not. Collective on frame */
PetscErrorCode LatinFrameFollow_Private(LatinStructure frame)
{
  const LatinStructure original = frame->original;
  PetscObjectState     state;

  PetscFunctionBegin;
  PetscCall(PetscObjectStateGet((PetscObject)original, &state));
  frame->load_state = original->load_state;
  frame->held_state = original->held_state;
  if (state == frame->original_state && original->e0_state == frame->original_e0) PetscFunctionReturn(0);
  frame->original_e0 = original->e0_state;
  frame->e0_state++;
  if (state == frame->original_state && original->base) { /* another time step: new spans, same operators */
    LatinFrameLengths(frame);
    PetscFunctionReturn(0);
  }
  PetscCall(LatinFramePenalty_Private(frame));
  PetscCall(PetscFree(frame->part));
  if (original->geometry == LATIN_GEOMETRY_LARGE) PetscCall(PetscMalloc1(LATIN_PART * frame->links_local + 1, &frame->part)); /* + 1: not NULL without links */
  PetscCall(LatinFrameRenew_Private(frame, NULL, original->base ? LATIN_FRAME_PRESENT : LATIN_FRAME_DRAWN));
  PetscCall(PetscObjectStateGet((PetscObject)frame, &frame->parts_state));
  frame->original_state = state;
  PetscFunctionReturn(0);
}

/* Creates the frame of a structure that is set up and whose geometry is not linear. Collective on original */
PetscErrorCode LatinFrameCreate_Private(LatinStructure original, LatinStructure *newframe)
{
  const PetscInt dim = original->dim, m = dim * original->links_local;
  LatinStructure frame;

  PetscFunctionBegin;
  PetscCall(LatinStructureDerive_Private(original, "Parts of links that turn", &frame));
  frame->original          = original;
  frame->original_state    = -1; /* not yet followed */
  frame->rigid_law         = -1;
  frame->keeps             = NULL;
  frame->links_local       = m;
  frame->links_global      = dim * original->links_global;
  frame->links_start       = dim * original->links_start;
  frame->prescribed        = original->prescribed;
  frame->vertex_prescribed = original->vertex_prescribed;
  frame->load              = original->load;
  PetscCall(PetscObjectReference((PetscObject)frame->load));
  frame->ground = original->ground;
  PetscCall(PetscObjectReference((PetscObject)frame->ground));
  PetscCall(PetscMalloc6(2 * m, &frame->nodes, 2 * m, &frame->ends, m, &frame->law, m, &frame->stiffness, m, &frame->e0, dim * m, &frame->direction));
  for (PetscInt i = 0; i < 2 * m; i++) {
    frame->nodes[i] = original->nodes[2 * (i / 2 / dim) + i % 2];
    frame->ends[i]  = original->ends[2 * (i / 2 / dim) + i % 2];
  }
  PetscCall(LatinFrameFollow_Private(frame));
  *newframe = frame;
  PetscFunctionReturn(0);
}
