#include "state/stateimpl.h"
#include "structure/turning.h"
#include <petsc/private/snesimpl.h>
#include <petsc/private/tsimpl.h>

/*
   What a run needs to go on to the bit where another one has ended: the displacements, for a motion the velocities and
   the time and the strains that the last step started from, and of SNES latin what a warm start takes up: the
   fixed-point unknowns of the last two solves, the displacements and forces that linear stages add to, the tensions of
   rigid links; where links turn the operators, multipliers, and where the last path has ended. Everything else is computed anew from the structure and the options.
*/

static PetscErrorCode LatinStateAdd_Private(LatinState *state, const char name[], Vec v)
{
  PetscFunctionBegin;
  PetscAssert(state->items < LATIN_STATE_ITEMS, PETSC_COMM_SELF, PETSC_ERR_PLIB, "More items than LATIN_STATE_ITEMS");
  PetscCall(PetscObjectReference((PetscObject)v));
  state->item[state->items].name = name;
  state->item[state->items++].v  = v;
  PetscFunctionReturn(0);
}

/* Numbers of this rank, which stay where they are; so many in a row */
static PetscErrorCode LatinStateAddArray_Private(LatinState *state, const char name[], PetscInt width, PetscInt n, const PetscReal x[])
{
  Vec v;

  PetscFunctionBegin;
  PetscCall(VecCreateMPIWithArray(PetscObjectComm((PetscObject)state->snes), width, n, PETSC_DETERMINE, x, &v));
  PetscCall(LatinStateAdd_Private(state, name, v));
  PetscCall(VecDestroy(&v));
  PetscFunctionReturn(0);
}

/* Operators where links turn, which are those of an earlier solve. Collective on frame */
static PetscErrorCode LatinStateFrame_Private(LatinState *state, LatinStructure frame)
{
  const LatinLarge *large = &((SNES_Latin *)state->snes->data)->large;

  PetscFunctionBegin;
  PetscCall(LatinStateAddArray_Private(state, "operator_row", frame->dim, frame->dim * frame->links_local, frame->direction));
  PetscCall(LatinStateAddArray_Private(state, "operator_part", LATIN_PART, frame->part ? LATIN_PART * frame->links_local : 0, frame->part));
  PetscCall(LatinStateAddArray_Private(state, "operator_stiffness", 1, frame->links_local, frame->stiffness));
  if (state->ts) PetscFunctionReturn(0);
  PetscCall(LatinStateAddArray_Private(state, "operator_kind", LATIN_STATE_KIND, LATIN_STATE_KIND, state->kind));
  PetscCall(LatinStateAddArray_Private(state, "multiplier", 1, frame->spring ? 2 * frame->turns->links_local : 0, frame->spring));
  PetscCall(LatinStateAdd_Private(state, "path", large->solution ? large->solution : state->u));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinStateItems_Private(LatinState *state)
{
  PetscFunctionBegin;
  PetscCall(LatinStateAdd_Private(state, "displacement", state->u));
  if (state->ts) {
    TS_Latin *data = (TS_Latin *)state->ts->data;

    PetscCall(LatinStateAdd_Private(state, "velocity", state->ts->vec_dot));
    PetscCall(LatinStateAdd_Private(state, "increment", data->w));
    PetscCall(LatinStateAddArray_Private(state, "initial_elongation", 1, data->step->links_local, data->step->e0)); /* tensions are those of the step */
    PetscCall(LatinStateAddArray_Private(state, "support", data->step->dim, data->step->dim * data->step->nodes_local, data->step->held));
    PetscCall(LatinStateAddArray_Private(state, "support_increment", data->step->dim, data->step->dim * data->step->nodes_local, data->step->prescribed));
    if (data->step->midpoint) PetscCall(LatinStateAddArray_Private(state, "link", data->step->dim, data->step->dim * data->step->links_local, data->step->span));
  }
  if (state->latin) {
    SNES_Latin        *data   = (SNES_Latin *)state->snes->data;
    const LatinLinear *linear = &data->latin->linear;
    LatinStructure     frame  = data->large.frame;

    if (!data->z_before) PetscCall(VecDuplicate(data->z, &data->z_before));
    PetscCall(LatinStateAdd_Private(state, "fixed_point", data->z));
    PetscCall(LatinStateAdd_Private(state, "fixed_point_before", data->z_before));
    PetscCall(LatinStateAddArray_Private(state, "subdomain_displacement", 1, linear->sub->bs * linear->sub->copies, linear->U));
    PetscCall(LatinStateAddArray_Private(state, "interface_pull", 1, linear->inter->sides, linear->pull));
    PetscCall(LatinStateAddArray_Private(state, "subdomain_tension", 1, linear->tension ? linear->sub->nonsmooth : 0, linear->tension));
    if (frame) PetscCall(LatinStateFrame_Private(state, frame));
    PetscCall(LatinStateAddArray_Private(state, "rigid_tension", 1, linear->rigid_tension ? linear->sub->structure->links_local : 0, linear->rigid_tension));
  }
  state->reals = state->items;
  PetscFunctionReturn(0);
}

/* What those look for who open a state in HDF5, in the caller's numbering; it is not read. The caller frees the room. Collective */
static PetscErrorCode LatinStateShow_Private(LatinState *state, PetscInt bytes, const char note[], PetscReal **room)
{
  const LatinStructure structure = state->structure;
  const TS_Latin      *data      = state->ts ? (TS_Latin *)state->ts->data : NULL;
  const PetscInt       dim = structure->dim, n = structure->nodes_local * dim, m = structure->links_local;
  PetscReal           *u, *v, *tension, *nodes, *letters;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(2 * n + 3 * m + bytes, room));
  u       = *room;
  v       = u + n;
  tension = v + n;
  nodes   = tension + m;
  letters = nodes + 2 * m;
  PetscCall(LatinStateAddArray_Private(state, "/nodes/coordinates", dim, n, structure->x));
  PetscCall(LatinStructureGetDisplacements(structure, state->u, u));
  PetscCall(LatinStateAddArray_Private(state, "/nodes/displacement", dim, n, u));
  if (data) {
    PetscCall(LatinStructureGetDisplacements(structure, state->ts->vec_dot, v));
    for (PetscInt i = 0; i < n; i++) v[i] = structure->fixed[i] ? 0.0 : v[i];
    PetscCall(LatinStateAddArray_Private(state, "/nodes/velocity", dim, n, v));
  }
  PetscCall(LatinSolverTensions_Private(state->snes, data ? data->step : structure, data ? data->w : state->u, tension));
  PetscCall(LatinStateAddArray_Private(state, "/links/tension", 1, m, tension));
  state->reals = state->items;
  for (PetscInt i = 0; i < 2 * m; i++) nodes[i] = (PetscReal)structure->nodes[i];
  PetscCall(LatinStateAddArray_Private(state, "/links/nodes", 2, 2 * m, nodes));
  for (PetscInt i = 0; i < bytes; i++) letters[i] = (PetscReal)(unsigned char)note[i];
  PetscCall(LatinStateAddArray_Private(state, "note", 1, bytes, letters));
  PetscFunctionReturn(0);
}

/* The structure without loads and initial elongations, which may change from one solve to the next; its partition, its interfaces and the search direction. Collective */
static PetscErrorCode LatinStateStructure_Private(const LatinState *state, double *all)
{
  const LatinStructure structure = state->structure;
  const size_t         n = (size_t)structure->nodes_local, m = (size_t)structure->links_local, dim = (size_t)structure->dim;
  const MPI_Comm       comm = PetscObjectComm((PetscObject)state->snes);
  PetscMPIInt          rank;
  uint64_t             hash;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  hash = LatinStateHash(((uint64_t)rank * 4 + dim) * 4 + (uint64_t)structure->geometry, n * dim * sizeof(PetscReal), structure->x);
  hash = LatinStateHash(hash, n * dim * sizeof(PetscBool), structure->fixed);
  hash = LatinStateHash(hash, n * sizeof(PetscReal), state->ts ? structure->mass : NULL);
  hash = LatinStateHash(hash, 2 * m * sizeof(PetscInt), structure->nodes);
  hash = LatinStateHash(hash, m * sizeof(PetscInt), structure->law);
  hash = LatinStateHash(hash, m * sizeof(PetscReal), structure->stiffness);
  hash = LatinStateHash(hash, m * sizeof(PetscReal), structure->friction);
  hash = LatinStateHash(hash, m * dim * sizeof(PetscReal), structure->direction);
  if (state->latin) {
    const Latin latin = ((SNES_Latin *)state->snes->data)->latin;

    hash = LatinStateHash(hash, (size_t)latin->sub.copies * sizeof(PetscInt), latin->sub.node);
    hash = LatinStateHash(hash, (size_t)latin->sub.links * 2 * sizeof(PetscInt), latin->sub.ends);
    hash = LatinStateHash(hash, (size_t)latin->inter.sides * sizeof(PetscInt), latin->inter.side_dof);
    if (!latin->sub.structure->turns) hash = LatinStateHash(hash, (size_t)latin->inter.sides * sizeof(PetscReal), latin->dir.d); /* where links turn it follows them */
  }
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &hash, 1, MPI_UINT64_T, MPI_BXOR, comm));
  *all = (double)hash;
  PetscFunctionReturn(0);
}

/* The parts of a solver that a state is made of. Collective on solver */
static PetscErrorCode LatinStateFind_Private(PetscObject solver, Vec u, LatinState *state)
{
  MPI_Comm  comm = PetscObjectComm(solver);
  PetscBool latin;

  PetscFunctionBegin;
  PetscCall(PetscMemzero(state, sizeof(*state)));
  PetscCheck(solver->classid == TS_CLASSID || solver->classid == SNES_CLASSID, comm, PETSC_ERR_ARG_WRONG, "The state of a SNES or a TS can be kept, not that of a %s", solver->class_name);
  if (solver->classid == TS_CLASSID) {
    state->ts = (TS)solver;
    PetscCall(PetscObjectTypeCompare(solver, TSLATIN, &latin));
    PetscCheck(latin, comm, PETSC_ERR_ARG_WRONG, "The state of a TS can be kept when it is of type latin, not %s: use -ts_type latin", solver->type_name ? solver->type_name : "unknown");
    PetscCall(TSGetSNES(state->ts, &state->snes));
    PetscCall(TSSetUp(state->ts));
    state->u         = state->ts->vec_sol;
    state->structure = ((TS_Latin *)state->ts->data)->step->base;
  } else {
    state->snes = (SNES)solver;
    state->u    = u;
    PetscCheck(u, comm, PETSC_ERR_ARG_NULL, "The state of a SNES goes with its solution: give the vector");
    PetscCall(SNESLatinFindStructure_Private(state->snes, &state->structure));
    PetscCheck(state->structure, comm, PETSC_ERR_ORDER, "The solver has no structure: give it one with LatinStructureAttachSNES()");
  }
  PetscCall(LatinStructureCheckVec_Private(state->structure, state->u));
  PetscCall(PetscObjectTypeCompare((PetscObject)state->snes, SNESLATIN, &state->latin));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinStateSave_Private(PetscObject solver, Vec u, const char file[], PetscInt n, const char note[])
{
  static const char *const endings[] = {".h5", ".hdf5", NULL};
  MPI_Comm                 comm      = PetscObjectComm(solver);
  LatinStateHead           head      = {0};
  LatinState               state;
  PetscReal               *room = NULL;
  PetscInt                 ending;
  PetscMPIInt              ranks, rank;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(comm, &ranks));
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  PetscCall(LatinStateFind_Private(solver, u, &state));
  PetscCall(PetscStrendswithwhich(file, endings, &ending));
  head.hdf5       = endings[ending] ? 1.0 : 0.0;
  head.ranks      = ranks;
  head.note_bytes = (double)n;
  if (state.ts) {
    const TS_Latin *data = (TS_Latin *)state.ts->data;

    head.motion    = 1.0;
    head.started   = data->started;
    head.shift     = (double)data->step->shift;
    head.time      = (double)state.ts->ptime;
    head.time_step = (double)state.ts->time_step;
    head.steps     = (double)state.ts->steps;
  }
  if (state.latin) {
    const SNES_Latin *data = (SNES_Latin *)state.snes->data;

    PetscCheck(data->z, comm, PETSC_ERR_ORDER, "There is no state yet: solve, or make a step, before");
    head.tuning    = (double)data->latin->tuning;
    head.solutions = data->has_state + (data->has_state && data->has_before);
    if (data->large.frame) state.kind[0] = (PetscReal)data->large.frame->made;
    state.kind[1] = data->large.solution ? 1.0 : 0.0;
  }
  PetscCall(LatinStateStructure_Private(&state, &head.structure));
  PetscCall(LatinStateItems_Private(&state));
  if (endings[ending]) PetscCall(LatinStateShow_Private(&state, rank ? 0 : n, note, &room));
  PetscCall(LatinStateWrite_Private(comm, file, &head, &state, note));
  PetscCall(PetscFree(room));
  PetscFunctionReturn(0);
}

/* Makes operators of what has been read. In statics the rest is then read again, for their room is new. Collective on state->snes */
static PetscErrorCode LatinStateOperators_Private(LatinState *state, const char file[], const LatinStateHead *head)
{
  SNES_Latin    *data  = (SNES_Latin *)state->snes->data;
  LatinStructure frame = data->large.frame;

  PetscFunctionBegin;
  PetscCall(PetscObjectStateIncrease((PetscObject)frame));
  if (state->ts) PetscFunctionReturn(0);
  frame->made = (LatinFrameType)state->kind[0];
  if (frame->part) PetscCall(LatinFrameSprings_Private(frame, PETSC_FALSE)); /* strains of the parts as they lie */
  PetscCall(LatinSetUp_Private(data->latin));
  state->items = 0;
  PetscCall(LatinStateItems_Private(state));
  PetscCall(LatinStateTransfer_Private(PetscObjectComm((PetscObject)state->snes), file, NULL, head, state));
  if (state->kind[1] == 0.0) PetscCall(VecDestroy(&data->large.solution));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinStateLoad_Private(PetscObject solver, Vec u, const char file[], PetscInt *n, char **note)
{
  MPI_Comm       comm = PetscObjectComm(solver);
  SNES_Latin    *snes;
  TS_Latin      *ts;
  LatinStateHead head;
  LatinState     state;
  double         structure;
  PetscMPIInt    ranks;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(comm, &ranks));
  PetscCall(LatinStateReadHead_Private(comm, file, &head, note));
  *n = (PetscInt)head.note_bytes;
  PetscCall(LatinStateFind_Private(solver, u, &state));
  snes = state.latin ? (SNES_Latin *)state.snes->data : NULL;
  ts   = state.ts ? (TS_Latin *)state.ts->data : NULL;
  PetscCheck(head.ranks == ranks, comm, PETSC_ERR_FILE_UNEXPECTED, "The state %s is of %d ranks, and these are %d: run on %d", file, (int)head.ranks, (int)ranks, (int)head.ranks);
  PetscCheck((head.motion != 0.0) == (ts != NULL), comm, PETSC_ERR_FILE_UNEXPECTED, "The state %s is that of %s", file, ts ? "a solve, not of a motion: leave out the time steps" : "a motion: give the number of time steps");
  if (ts) PetscCall(LatinStepLength_Private(ts->step, head.shift > 0.0 ? (PetscReal)head.shift : -1.0));
  if (snes && state.structure->geometry == LATIN_GEOMETRY_LINEAR) { /* the search parameters of rigid links that the solves before have found, before anything is built with others */
    PetscCall(LatinSetProblem_Private(snes->latin, ts ? ts->step : state.structure, NULL));
    if (head.tuning > 0.0 && head.tuning != (double)snes->latin->tuning) PetscCall(LatinParameterTune_Private(snes->latin, (PetscReal)head.tuning / snes->latin->tuning));
  }
  PetscCall(SNESSetUp(state.snes));
  PetscCall(LatinStateStructure_Private(&state, &structure));
  PetscCheck(head.structure == structure, comm, PETSC_ERR_FILE_UNEXPECTED, "The state %s is of another structure, partition or method: give the same scene and the same options", file);
  if (snes && snes->large.frame && !ts && !snes->large.solution) PetscCall(VecDuplicate(u, &snes->large.solution));
  PetscCall(LatinStateItems_Private(&state));
  PetscCall(LatinStateTransfer_Private(comm, file, NULL, &head, &state));
  if (snes && snes->large.frame) PetscCall(LatinStateOperators_Private(&state, file, &head));
  if (ts) {
    PetscCall(LatinStepPlaced_Private(ts->step));
    ts->started         = (PetscBool)(head.started != 0.0);
    state.ts->ptime     = (PetscReal)head.time;
    state.ts->time_step = (PetscReal)head.time_step;
    PetscCall(TSSetStepNumber(state.ts, (PetscInt)head.steps));
  }
  if (snes) {
    snes->has_state  = (PetscBool)(head.solutions > 0.0);
    snes->has_before = (PetscBool)(head.solutions > 1.0);
  }
  PetscFunctionReturn(0);
}

/*@C
  LatinStateSave - Writes what a solver needs to go on to the bit in another run.

  Collective on solver

  Input Parameters:
+ solver - a SNES of any type after a solve, or a TS of type latin after a step
. u      - the solution of the SNES; NULL for a TS
. file   - its name: HDF5 when it ends in .h5 or .hdf5, else PETSc's binary format; an older one is replaced in one step and keeps its mode
. n      - length of the note
- note   - bytes of the caller's own, from the first rank

  Level: intermediate

  Note:
  Loads, initial elongations and prescribed displacements are not written: the caller has them; where the supports of a motion are is. A symbolic link stays, and
  what it leads to is replaced. Raises an error on every rank, and leaves all as it was, when the name is that of a folder,
  a named pipe, a socket or a device, when its folder is not there or may not be written to, when the disk is full, and
  while another run writes the same state.

.seealso: `LatinStateLoad()`, `SNESLatinSetWarmStart()`
@*/
PetscErrorCode LatinStateSave(PetscObject solver, Vec u, const char file[], PetscInt n, const char note[])
{
  PetscFunctionBegin;
  PetscValidHeader(solver, 1);
  LatinWatch(PetscObjectComm(solver), LatinStateSave_Private(solver, u, file, n, note));
  PetscFunctionReturn(0);
}

/*@C
  LatinStateLoad - Reads what `LatinStateSave()` has written, for the same structure, options and number of ranks.

  Collective on solver

  Input Parameters:
+ solver - a SNES with its structure and options, or a TS of type latin with those and its solution
. u      - the solution of the SNES, overwritten; NULL for a TS
- file   - name of the file

  Output Parameters:
+ n    - length of the note
- note - the caller's own bytes and a zero, on every rank; free with PetscFree()

  Level: intermediate

  Note:
  The next solve of SNES latin goes on from the state when it starts warm. The next step of the TS follows the saved one.

.seealso: `LatinStateSave()`, `SNESLatinSetWarmStart()`
@*/
PetscErrorCode LatinStateLoad(PetscObject solver, Vec u, const char file[], PetscInt *n, char *note[])
{
  PetscFunctionBegin;
  PetscValidHeader(solver, 1);
  LatinWatch(PetscObjectComm(solver), LatinStateLoad_Private(solver, u, file, n, note));
  PetscFunctionReturn(0);
}
