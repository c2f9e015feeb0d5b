#include "snes/sneslatinimpl.h"

/*
   Structures with friction that slide or fall without end, although forces inside the friction cones balance the loads: no slip leads to these
   forces, as friction is not associated. The map G of the iteration then moves each state z of a ray by the same step s,

     G(z + a s) = z + a s + s,  a >= 0.

   1. The damped plain iteration from rest converges to a ray: its steps become s. Anderson's acceleration does not: it minimises the step, and where
      G has no fixed point the least step is not one that G repeats, as the operators of contacts that slip are not symmetric.
   2. Slow modes of the steps are extrapolated (LatinSlidesExtrapolate_Private, A. Aitken).
   3. Contacts that are open, stick or slip at both ends of a part of a ray do so between them. So the iteration leaps to the next change, as the gap
      that closes after a long slide (LatinSlidesLeap_Private). If there is none before displacements are larger than the structure, it ends: there is
      no equilibrium along the ray, and the displacements along it are the motion. There may be one elsewhere.
*/

#define LATIN_SLIDES_MOST   5000 /* most stages */
#define LATIN_SLIDES_WINDOW 100  /* stages between two tests */
#define LATIN_SLIDES_IDLE   15   /* most windows without progress: cycles */
#define LATIN_SLIDES_DAMP   0.8  /* part of the step that the plain iteration takes */
#define LATIN_SLIDES_EXACT  1e-9 /* largest relative change of the step per stage of a leap */
#define LATIN_SLIDES_SAME   0.1  /* largest relative change of the step along a ray to displacements larger than the structure */
#define LATIN_SLIDES_LEAP   1e12 /* longest leap, in stages */
#define LATIN_SLIDES_ALONG  0.9  /* least cosine of the angle between successive changes of the step that are one mode */
#define LATIN_SLIDES_SLOW   0.99 /* largest ratio of these changes */

enum { LATIN_SLIDES_STATE, LATIN_SLIDES_STEP, LATIN_SLIDES_END, LATIN_SLIDES_THERE, LATIN_SLIDES_PAST, LATIN_SLIDES_CHANGE, LATIN_SLIDES_BEFORE, LATIN_SLIDES_VECS };

typedef struct {
  Latin     latin;
  Vec      *v;         /* states: z, s; end of a leap, its step; z a window ago, change of s in this window and in the last one */
  Vec       u, motion; /* displacements at z; from there to the end of a leap */
  PetscInt  known;     /* successive windows without extrapolation */
  PetscInt  idle;      /* windows without progress */
  PetscReal least;     /* least relative change of the step over a window of the ray */
} LatinSlides;

/* Computes the step s = G(z) - z and the displacements u. Collective on latin */
static PetscErrorCode LatinSlidesStep_Private(Latin latin, Vec z, Vec s, Vec u)
{
  PetscFunctionBegin;
  PetscCall(LatinApply_Private(&latin->linear, z, s));
  PetscCall(VecAXPY(s, -1.0, z));
  PetscCall(LatinAverage_Private(&latin->linear, u));
  PetscFunctionReturn(0);
}

/* Computes the step s at z. If its changes in the last two windows are one mode, replaces z by the limit of this mode. Collective */
static PetscErrorCode LatinSlidesExtrapolate_Private(LatinSlides *run)
{
  Vec        *v   = run->v;
  PetscReal   now = 0.0, before = 0.0, ratio;
  PetscScalar dot = 0.0;

  PetscFunctionBegin;
  PetscCall(LatinSlidesStep_Private(run->latin, v[LATIN_SLIDES_STATE], v[LATIN_SLIDES_STEP], run->u));
  if (run->known > 0) PetscCall(VecAYPX(v[LATIN_SLIDES_CHANGE], -1.0, v[LATIN_SLIDES_STEP]));
  if (run->known > 1) {
    PetscCall(VecNorm(v[LATIN_SLIDES_CHANGE], NORM_2, &now));
    PetscCall(VecNorm(v[LATIN_SLIDES_BEFORE], NORM_2, &before));
    PetscCall(VecDot(v[LATIN_SLIDES_CHANGE], v[LATIN_SLIDES_BEFORE], &dot));
  }
  if (now > 0.0 && PetscRealPart(dot) > LATIN_SLIDES_ALONG * now * before && PetscRealPart(dot) < LATIN_SLIDES_SLOW * PetscSqr(before)) {
    ratio = PetscRealPart(dot) / PetscSqr(before);
    PetscCall(VecAXPBY(v[LATIN_SLIDES_STATE], -ratio / (1.0 - ratio), 1.0 / (1.0 - ratio), v[LATIN_SLIDES_PAST]));
    PetscCall(LatinSlidesStep_Private(run->latin, v[LATIN_SLIDES_STATE], v[LATIN_SLIDES_STEP], run->u));
    run->known = 0;
    PetscFunctionReturn(0);
  }
  if (run->known > 0) PetscCall(VecCopy(v[LATIN_SLIDES_CHANGE], v[LATIN_SLIDES_BEFORE]));
  PetscCall(VecCopy(v[LATIN_SLIDES_STATE], v[LATIN_SLIDES_PAST]));
  PetscCall(VecCopy(v[LATIN_SLIDES_STEP], v[LATIN_SLIDES_CHANGE])); /* becomes the change in the next window */
  run->known++;
  PetscFunctionReturn(0);
}

/* Leaps along the ray from z to the next change of contacts. *slides: there is none; then run->motion is the motion. Collective */
static PetscErrorCode LatinSlidesLeap_Private(LatinSlides *run, PetscBool *slides)
{
  const Latin latin = run->latin;
  Vec        *v     = run->v;
  PetscReal   step, change, leap = 0.0;

  PetscFunctionBegin;
  *slides = PETSC_FALSE;
  run->idle++;
  PetscCall(VecNorm(v[LATIN_SLIDES_STEP], NORM_2, &step));
  for (PetscReal a = LATIN_SLIDES_WINDOW; step > 0.0 && a < LATIN_SLIDES_LEAP && !*slides; a *= 2.0) {
    PetscCall(VecWAXPY(v[LATIN_SLIDES_END], a, v[LATIN_SLIDES_STEP], v[LATIN_SLIDES_STATE]));
    PetscCall(LatinSlidesStep_Private(latin, v[LATIN_SLIDES_END], v[LATIN_SLIDES_THERE], run->motion));
    if (latin->linear.failed) break;
    PetscCall(VecAXPY(v[LATIN_SLIDES_THERE], -1.0, v[LATIN_SLIDES_STEP]));
    PetscCall(VecNorm(v[LATIN_SLIDES_THERE], NORM_2, &change));
    change /= step;
    if (a == LATIN_SLIDES_WINDOW && change < 0.5 * run->least) {
      run->least = change;
      run->idle  = 0;
    }
    if (!(change <= LATIN_SLIDES_SAME)) break;
    if (change <= LATIN_SLIDES_EXACT * a) leap = a;
    PetscCall(VecAXPY(run->motion, -1.0, run->u));
    PetscCall(LatinEquilibriumFar_Private(latin->sub.structure, run->motion, slides));
  }
  PetscCall(PetscInfo(latin, "Step %g; leap by %g of them; changed least by %g in a window\n", (double)step, (double)leap, (double)run->least));
  if (*slides || leap == 0.0) PetscFunctionReturn(0);
  PetscCall(VecAXPY(v[LATIN_SLIDES_STATE], leap, v[LATIN_SLIDES_STEP]));
  run->known = run->idle = 0;
  run->least             = PETSC_MAX_REAL;
  PetscFunctionReturn(0);
}

/* Iterates, at most for `most` stages. Collective */
static PetscErrorCode LatinSlidesRun_Private(LatinSlides *run, PetscInt most, PetscBool *slides)
{
  LatinLinear   *linear = &run->latin->linear;
  const PetscInt last   = linear->applications + most;
  Vec            z = run->v[LATIN_SLIDES_STATE], Gz = run->v[LATIN_SLIDES_END];

  PetscFunctionBegin;
  PetscCall(LatinInitialState_Private(linear, z));
  for (*slides = PETSC_FALSE; !*slides && !linear->failed && run->idle < LATIN_SLIDES_IDLE && linear->applications < last - 2 * LATIN_SLIDES_WINDOW;) {
    for (PetscInt k = 0; k < LATIN_SLIDES_WINDOW && !linear->failed; k++) {
      PetscCall(LatinApply_Private(linear, z, Gz));
      PetscCall(VecAXPBY(z, LATIN_SLIDES_DAMP, 1.0 - LATIN_SLIDES_DAMP, Gz));
    }
    PetscCall(LatinSlidesExtrapolate_Private(run));
    if (!linear->failed) PetscCall(LatinSlidesLeap_Private(run, slides));
  }
  PetscFunctionReturn(0);
}

/* Returns whether the search is due: once per solve, if the iteration goes on for long after Newton's method has failed, or diverges unexplained */
static PetscBool SNESLatinSlidesDue(const SNES_Latin *data, LatinNext next)
{
  if (data->newton.slides == PETSC_MAX_INT || LatinEquilibriumExplained(&data->found)) return PETSC_FALSE;
  return (PetscBool)(next == LATIN_NEXT_DIVERGED || (next == LATIN_NEXT_CONTINUE && data->latin->linear.applications >= data->newton.slides));
}

/*
   Searches for a ray. If there is one, *next becomes LATIN_NEXT_DIVERGED, and data->found lists the nodes that move; else the state is unchanged. The
   stages count as Newton's. Collective on snes
*/
PetscErrorCode SNESLatinSlides_Private(SNES snes, LatinNext *next)
{
  SNES_Latin          *data         = (SNES_Latin *)snes->data;
  const Latin          latin        = data->latin;
  const LatinStructure structure    = latin->sub.structure;
  const PetscInt       applications = latin->linear.applications, dofs = latin->sub.bs * latin->sub.copies;
  LatinSlides          run = {.latin = latin, .least = PETSC_MAX_REAL};
  PetscReal           *U;
  PetscBool            slides;

  PetscFunctionBegin;
  if (!SNESLatinSlidesDue(data, *next)) PetscFunctionReturn(0);
  data->newton.slides = PETSC_MAX_INT;
  PetscCall(PetscMalloc1(dofs, &U));
  PetscCall(PetscArraycpy(U, latin->linear.U, dofs));
  PetscCall(VecDuplicateVecs(data->z, LATIN_SLIDES_VECS, &run.v));
  PetscCall(DMGetGlobalVector(structure->dm, &run.u));
  PetscCall(DMGetGlobalVector(structure->dm, &run.motion));
  PetscCall(LatinSlidesRun_Private(&run, PetscMin(LATIN_SLIDES_MOST, SNESLatinStagesLeft(snes)), &slides));
  if (slides) {
    PetscCall(VecCopy(run.v[LATIN_SLIDES_STATE], data->z));
    PetscCall(PetscMemzero(&data->found, sizeof(data->found)));
    PetscCall(LatinEquilibriumMoved_Private(structure, run.motion, &data->found));
    PetscCall(LatinStructureSize_Private(structure, &data->found.distance, NULL)); /* no proof of an infinite one */
    data->found.slides = PETSC_TRUE;
    *next              = LATIN_NEXT_DIVERGED;
  } else PetscCall(PetscArraycpy(latin->linear.U, U, dofs));
  data->newton.stages += latin->linear.applications - applications;
  PetscCall(LatinApply_Private(&latin->linear, data->z, run.v[LATIN_SLIDES_STEP])); /* displacements and tensions at the state */
  latin->linear.applications = applications;
  data->current              = -1;
  PetscCall(DMRestoreGlobalVector(structure->dm, &run.motion));
  PetscCall(DMRestoreGlobalVector(structure->dm, &run.u));
  PetscCall(VecDestroyVecs(LATIN_SLIDES_VECS, &run.v));
  PetscCall(PetscFree(U));
  PetscFunctionReturn(0);
}
