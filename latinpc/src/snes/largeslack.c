#include "snes/sneslatinimpl.h"
#include "structure/turned.h"

/*
   Finds nodes that slack links leave free. A link rests if it bears nothing within the requested error: a slack one, or a bar without force. If all
   links of a node rest, one of them slack, and do not hold it in all directions, as in a guy that has gone slack or at the lower end of a strut whose
   cables have, the node gives way to each of them. So none of these links holds its other node either, which may then be free as well: the search is
   repeated along the guy. Without a slack link such a node is a mechanism, which is told.
*/

#define LATIN_SLACK_HELD PETSC_SQRT_MACHINE_EPSILON /* least pivot of the sum of n n^t of a node; less is rounding */

#define LATIN_SLACK_NONE PETSC_SQRT_MACHINE_EPSILON /* largest tension of a link that bears nothing, relative to the largest of all links */

/*
   Work arrays, vectors [vertices][dim]: free, 1 for components without support; busy, not zero at nodes of links that bear; loose, not zero at nodes of
   slack links; column, the columns of the sums of n n^t over links that rest and hold
*/
typedef struct {
  LatinStructure structure;
  PetscReal     *n; /* [links_local][dim] */
  PetscBool     *rests;
  Vec            free, busy, loose, column[3];
} LatinSlack;

/* Adds the parts of all ranks in local. Collective on structure */
static PetscErrorCode LatinSlackSum_Private(LatinStructure structure, Vec local)
{
  Vec sum;

  PetscFunctionBegin;
  PetscCall(DMGetGlobalVector(structure->dm, &sum));
  PetscCall(VecZeroEntries(sum));
  PetscCall(DMLocalToGlobal(structure->dm, local, ADD_VALUES, sum));
  PetscCall(LatinStructureGetLocal_Private(structure, NULL, sum, local));
  PetscCall(DMRestoreGlobalVector(structure->dm, &sum));
  PetscFunctionReturn(0);
}

/* Computes n and rests of the links at u, free, busy and loose. near: strain from a kink within which a link may rest. Collective on slack->structure */
static PetscErrorCode LatinSlackRests_Private(const LatinSlack *slack, Vec u, PetscReal near)
{
  const LatinStructure structure = slack->structure;
  const PetscInt       dim       = structure->dim;
  const PetscScalar   *a;
  PetscScalar         *busy, *loose;
  PetscReal            most = 0.0;
  Vec                  at, ones;

  PetscFunctionBegin;
  PetscCall(DMGetGlobalVector(structure->dm, &ones));
  PetscCall(VecSet(ones, 1.0));
  PetscCall(LatinStructureGetLocal_Private(structure, NULL, ones, slack->free));
  PetscCall(DMRestoreGlobalVector(structure->dm, &ones));
  PetscCall(VecZeroEntries(slack->busy));
  PetscCall(VecZeroEntries(slack->loose));
  PetscCall(VecGetArray(slack->busy, &busy));
  PetscCall(VecGetArray(slack->loose, &loose));
  PetscCall(LatinStructureOpen_Private(structure, structure->vertex_prescribed, u, &at, &a));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    LatinTurned link;

    LatinTurnedLink(structure, NULL, l, a, &link);
    most = PetscMax(most, PetscAbsReal(link.tension));
  }
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &most, 1, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)structure)));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    LatinTurned link;

    LatinTurnedLink(structure, NULL, l, a, &link);
    slack->rests[l] = PETSC_FALSE;
    for (PetscInt s = -1; s < 2 && PetscAbsReal(link.tension) <= LATIN_SLACK_NONE * most; s += 2) {
      const PetscReal x = link.x + s * near;

      if (LatinStructureTangent(structure, l, x) == 0.0 && LatinStructureTension(structure, NULL, l, x) == 0.0) slack->rests[l] = PETSC_TRUE;
    }
    for (PetscInt i = 0; i < 2 * dim && slack->rests[l]; i++) loose[dim * structure->ends[2 * l + i / dim] + i % dim] += 1.0;
    if (PetscAbsReal(link.tension) < LATIN_SLACK_NONE * most) slack->rests[l] = PETSC_TRUE;
    for (PetscInt c = 0; c < dim; c++) {
      slack->n[dim * l + c] = link.n[c];
      for (PetscInt end = 0; end < 2 && !slack->rests[l]; end++) busy[dim * structure->ends[2 * l + end] + c] += 1.0;
    }
  }
  PetscCall(LatinStructureClose_Private(structure, &at, &a));
  PetscCall(VecRestoreArray(slack->loose, &loose));
  PetscCall(VecRestoreArray(slack->busy, &busy));
  PetscCall(LatinSlackSum_Private(structure, slack->busy));
  PetscCall(LatinSlackSum_Private(structure, slack->loose));
  PetscFunctionReturn(0);
}

/* Whether the symmetric matrix m, [dim][dim], is positive definite beyond rounding. Overwrites m */
static PetscBool LatinSlackDefinite(PetscInt dim, PetscReal m[])
{
  for (PetscInt k = 0; k < dim; k++) {
    if (m[dim * k + k] <= LATIN_SLACK_HELD) return PETSC_FALSE;
    for (PetscInt i = k + 1; i < dim; i++)
      for (PetscInt j = k + 1; j < dim; j++) m[dim * i + j] -= m[dim * i + k] * m[dim * k + j] / m[dim * k + k];
  }
  return PETSC_TRUE;
}

/* Sets slope to LATIN_SLACK for resting links of free nodes. *changes: one of them held before. Collective on slack->structure */
static PetscErrorCode LatinSlackGo_Private(const LatinSlack *slack, PetscReal slope[], PetscBool *changes)
{
  const LatinStructure structure = slack->structure;
  const PetscInt       dim       = structure->dim;
  const PetscScalar   *busy, *loose, *free;
  PetscScalar         *column[3];
  PetscMPIInt          any = 0;

  PetscFunctionBegin;
  for (PetscInt c = 0; c < dim; c++) {
    PetscCall(VecZeroEntries(slack->column[c]));
    PetscCall(VecGetArray(slack->column[c], &column[c]));
    for (PetscInt l = 0; l < structure->links_local; l++)
      for (PetscInt i = 0; i < 2 * dim && slack->rests[l] && slope[l] > 0.0; i++) column[c][dim * structure->ends[2 * l + i / dim] + i % dim] += slack->n[dim * l + i % dim] * slack->n[dim * l + c];
    PetscCall(VecRestoreArray(slack->column[c], &column[c]));
    PetscCall(LatinSlackSum_Private(structure, slack->column[c]));
    PetscCall(VecGetArray(slack->column[c], &column[c]));
  }
  PetscCall(VecGetArrayRead(slack->busy, &busy));
  PetscCall(VecGetArrayRead(slack->loose, &loose));
  PetscCall(VecGetArrayRead(slack->free, &free));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    for (PetscInt end = 0; end < 2 && slack->rests[l] && slope[l] >= 0.0; end++) {
      const PetscInt first = dim * structure->ends[2 * l + end];
      PetscReal      m[9], none = 1.0;

      for (PetscInt i = 0; i < dim; i++) {
        if (PetscRealPart(busy[first + i]) > 0.0) none = 0.0;
        if (PetscRealPart(free[first + i]) > 0.0 && PetscRealPart(loose[first + i]) == 0.0) none = 0.0;
        for (PetscInt c = 0; c < dim; c++) m[dim * i + c] = PetscRealPart(free[first + i]) * PetscRealPart(free[first + c]) * PetscRealPart(column[c][first + i]);
        if (PetscRealPart(free[first + i]) == 0.0) m[dim * i + i] = 1.0;
      }
      if (none == 0.0 || LatinSlackDefinite(dim, m)) continue;
      if (slope[l] > 0.0) any = 1;
      slope[l] = LATIN_SLACK;
    }
  }
  PetscCall(VecRestoreArrayRead(slack->free, &free));
  PetscCall(VecRestoreArrayRead(slack->loose, &loose));
  PetscCall(VecRestoreArrayRead(slack->busy, &busy));
  for (PetscInt c = 0; c < dim; c++) PetscCall(VecRestoreArray(slack->column[c], &column[c]));
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &any, 1, MPI_INT, MPI_MAX, PetscObjectComm((PetscObject)structure)));
  *changes = (PetscBool)any;
  PetscFunctionReturn(0);
}

/* Sets slope to LATIN_SLACK for links of nodes that slack links leave free at u. Links nearer to a kink than `near` count as slack. Collective on structure */
PetscErrorCode LatinPathSlack_Private(LatinStructure structure, Vec u, PetscReal near, PetscReal slope[])
{
  const PetscInt dim     = structure->dim;
  LatinSlack     slack   = {.structure = structure};
  PetscBool      changes = PETSC_TRUE;

  PetscFunctionBegin;
  PetscCall(PetscMalloc2(dim * structure->links_local, &slack.n, structure->links_local, &slack.rests));
  PetscCall(DMGetLocalVector(structure->dm, &slack.free));
  PetscCall(DMGetLocalVector(structure->dm, &slack.busy));
  PetscCall(DMGetLocalVector(structure->dm, &slack.loose));
  for (PetscInt c = 0; c < dim; c++) PetscCall(DMGetLocalVector(structure->dm, &slack.column[c]));
  PetscCall(LatinSlackRests_Private(&slack, u, near));
  while (changes) PetscCall(LatinSlackGo_Private(&slack, slope, &changes));
  for (PetscInt c = 0; c < dim; c++) PetscCall(DMRestoreLocalVector(structure->dm, &slack.column[c]));
  PetscCall(DMRestoreLocalVector(structure->dm, &slack.loose));
  PetscCall(DMRestoreLocalVector(structure->dm, &slack.busy));
  PetscCall(DMRestoreLocalVector(structure->dm, &slack.free));
  PetscCall(PetscFree2(slack.n, slack.rests));
  PetscFunctionReturn(0);
}
