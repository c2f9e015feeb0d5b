#include "state/stateimpl.h"
#include "structure/turning.h"
#include <petsc/private/snesimpl.h>
#include <petsc/private/tsimpl.h>

/*
   The state from which another run continues to the bit:

     displacements;
     of a motion: velocities, time, displacements of the last step, strains at its start, supports; with large displacements the links at its start;
     of SNES latin, for a warm start: fixed-point unknowns of the last two solves; displacements, forces of search directions and tensions that linear
     stages increment; tensions of rigid links; with large rotations operators, in statics also multipliers and the end of the last path.

   All other data is computed from the structure and the options.
*/

/* Adds a vector as an item, by reference. Not collective */
static PetscErrorCode LatinStateAdd_Private(LatinState *state, const char name[], Vec v)
{
  PetscFunctionBegin;
  PetscAssert(state->items < LATIN_STATE_ITEMS, PETSC_COMM_SELF, PETSC_ERR_PLIB, "More items than LATIN_STATE_ITEMS");
  PetscCall(PetscObjectReference((PetscObject)v));
  state->item[state->items].name = name;
  state->item[state->items++].v  = v;
  PetscFunctionReturn(0);
}

/* Adds this rank's array x, [n], as an item without copying it; width: entries of a row of the dataset. Collective on state->snes */
static PetscErrorCode LatinStateAddArray_Private(LatinState *state, const char name[], PetscInt width, PetscInt n, const PetscReal x[])
{
  Vec v;

  PetscFunctionBegin;
  PetscCall(VecCreateMPIWithArray(PetscObjectComm((PetscObject)state->snes), width, n, PETSC_DETERMINE, x, &v));
  PetscCall(LatinStateAdd_Private(state, name, v));
  PetscCall(VecDestroy(&v));
  PetscFunctionReturn(0);
}

/* Adds operators, multipliers and path of a frame, which come from earlier solves. Collective on frame */
static PetscErrorCode LatinStateFrame_Private(LatinState *state, LatinStructure frame)
{
  const LatinLarge *large = &((SNES_Latin *)state->snes->data)->large;

  PetscFunctionBegin;
  if (frame->original->geometry != LATIN_GEOMETRY_PRESTRESS) { /* prestress: operators follow from the structure */
    PetscCall(LatinStateAddArray_Private(state, "operator_row", frame->dim, frame->dim * frame->links_local, frame->direction));
    PetscCall(LatinStateAddArray_Private(state, "operator_part", LATIN_PART, frame->part ? LATIN_PART * frame->links_local : 0, frame->part));
    PetscCall(LatinStateAddArray_Private(state, "operator_stiffness", 1, frame->links_local, frame->stiffness));
  }
  if (state->ts) PetscFunctionReturn(0);
  PetscCall(LatinStateAddArray_Private(state, "operator_kind", LATIN_STATE_KIND, LATIN_STATE_KIND, state->kind));
  PetscCall(LatinStateAddArray_Private(state, "multiplier", 1, frame->spring ? 2 * frame->original->links_local : 0, frame->spring));
  PetscCall(LatinStateAdd_Private(state, "path", large->path.solution ? large->path.solution : state->u));
  PetscFunctionReturn(0);
}

/* Adds all items that are read again. Collective on state->snes */
static PetscErrorCode LatinStateItems_Private(LatinState *state)
{
  PetscFunctionBegin;
  PetscCall(LatinStateAdd_Private(state, "displacement", state->u));
  if (state->ts) {
    TS_Latin *data = (TS_Latin *)state->ts->data;

    PetscCall(LatinStateAdd_Private(state, "velocity", state->ts->vec_dot));
    PetscCall(LatinStateAdd_Private(state, "increment", data->w));
    PetscCall(LatinStateAddArray_Private(state, "initial_elongation", 1, data->step->links_local, data->step->e0)); /* strains at its start */
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

/* Adds items for users who open the HDF5 file, in the caller's numbering, and the note; they are not read. The caller frees *room. Collective on state->snes */
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

/* Adds the points of the tables of links here to a hash: numbers of laws may differ in another program. Not collective */
static PetscErrorCode LatinStateTables_Private(const LatinStructure structure, uint64_t *hash)
{
  PetscBool *used;

  PetscFunctionBegin;
  PetscCall(PetscCalloc1(LatinLawCount, &used));
  for (PetscInt l = 0; l < structure->links_local; l++) used[structure->law[l]] = PETSC_TRUE;
  for (PetscInt law = 0; law < LatinLawCount; law++) {
    const PetscReal *strain = NULL, *tension = NULL;
    const size_t     size = used[law] ? (size_t)LatinLawPoints(law, &strain, &tension) * sizeof(PetscReal) : 0;

    if (!size) continue;
    *hash = LatinStateHash(*hash, size, strain);
    *hash = LatinStateHash(*hash, size, tension);
  }
  PetscCall(PetscFree(used));
  PetscFunctionReturn(0);
}

/*
   Computes a hash of structure, partition, interfaces and search direction, not of loads and initial elongations, which may change. Collective on
   state->snes
*/
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
  PetscCall(LatinStateTables_Private(structure, &hash));
  hash = LatinStateHash(hash, m * sizeof(PetscReal), structure->stiffness);
  hash = LatinStateHash(hash, m * sizeof(PetscReal), structure->friction);
  hash = LatinStateHash(hash, m * dim * sizeof(PetscReal), structure->direction);
  if (state->latin) {
    const Latin latin = ((SNES_Latin *)state->snes->data)->latin;

    hash = LatinStateHash(hash, (size_t)latin->sub.copies * sizeof(PetscInt), latin->sub.node);
    hash = LatinStateHash(hash, (size_t)latin->sub.links * 2 * sizeof(PetscInt), latin->sub.ends);
    hash = LatinStateHash(hash, (size_t)latin->inter.sides * sizeof(PetscInt), latin->inter.side_dof);
    /* large rotations change the search direction */
    if (!latin->sub.structure->original) hash = LatinStateHash(hash, (size_t)latin->inter.sides * sizeof(PetscReal), latin->dir.d);
  }
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &hash, 1, MPI_UINT64_T, MPI_BXOR, comm));
  *all = (double)hash;
  PetscFunctionReturn(0);
}

/* Finds the SNES, the TS, the solution and the structure of a SNES, with its solution u, or of a TS. Collective on solver */
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
    PetscCheck(state->structure, comm, PETSC_ERR_ORDER, "The solver has no structure: give it one with LatinStructureAttachSNES() (in Python, latinpc.Structure(...).attach(snes))");
  }
  PetscCall(LatinStructureCheckVec_Private(state->structure, state->u));
  PetscCall(PetscObjectTypeCompare((PetscObject)state->snes, SNESLATIN, &state->latin));
  PetscFunctionReturn(0);
}

/* Returns the hash of the initial elongations of this rank. Not collective */
static PetscReal LatinStateElongations(const LatinStructure structure)
{
  return (PetscReal)LatinStateHash(0, (size_t)structure->links_local * sizeof(PetscReal), structure->e0);
}

static PetscErrorCode LatinStateSave_Private(PetscObject solver, Vec u, const char file[], PetscInt n, const char note[])
{
  static const char *const endings[] = {".h5", ".hdf5", NULL};
  MPI_Comm                 comm      = PetscObjectComm(solver);
  LatinStateHead           head      = {0};
  LatinState               state;
  PetscReal               *room = NULL;
  PetscErrorCode           ierr;
  PetscInt                 ending;
  PetscMPIInt              ranks, rank;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(comm, &ranks));
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  LatinAgree(comm, n < 0, PETSC_ERR_ARG_OUTOFRANGE, "The note of a state has %" PetscInt_FMT " bytes: give its length, 0 for none", n);
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
    head.tuning      = (double)data->latin->tuning;
    head.rigid_scale = (double)data->latin->rigid_scale;
    head.solutions   = data->has_state + (data->has_state && data->has_before);
    if (data->large.frame) state.kind[0] = (PetscReal)data->large.frame->made;
    state.kind[1] = data->large.path.solution ? 1.0 : 0.0;
    if (data->large.frame) state.kind[2] = LatinStateElongations(data->large.frame->original);
  }
  PetscCall(LatinStateStructure_Private(&state, &head.structure));
  PetscCall(LatinStateItems_Private(&state));
  if (endings[ending]) PetscCall(LatinStateShow_Private(&state, rank ? 0 : n, note, &room));
  ierr = LatinStateWrite_Private(comm, file, &head, &state, note);
  PetscCall(PetscFree(room));
  PetscCall(ierr); /* a disk may be full */
  PetscFunctionReturn(0);
}

/*
   Sets up the operators of a frame that have been read. In statics this allocates new arrays: all items are read again. If initial elongations have
   changed since, the next solve recomputes the operators, as without a state. Collective on state->snes
*/
static PetscErrorCode LatinStateOperators_Private(LatinState *state, const char file[], const LatinStateHead *head)
{
  SNES_Latin    *data  = (SNES_Latin *)state->snes->data;
  LatinStructure frame = data->large.frame;
  PetscMPIInt    other = (PetscMPIInt)(state->kind[2] != LatinStateElongations(frame->original));

  PetscFunctionBegin;
  PetscCall(PetscObjectStateIncrease((PetscObject)frame));
  if (state->ts) PetscFunctionReturn(0);
  frame->made = (LatinFrameType)state->kind[0];
  if (frame->part) PetscCall(LatinFrameSprings_Private(frame, PETSC_FALSE)); /* initial elongations of the parts */
  PetscCall(LatinSetUp_Private(data->latin));
  state->items = 0;
  PetscCall(LatinStateItems_Private(state));
  PetscCall(LatinStateTransfer_Private(PetscObjectComm((PetscObject)state->snes), file, NULL, head, state));
  if (state->kind[1] == 0.0) PetscCall(VecDestroy(&data->large.path.solution));
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &other, 1, MPI_INT, MPI_MAX, PetscObjectComm((PetscObject)frame)));
  if (other) frame->original_e0 = -1;
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
  if (snes && state.structure->geometry == LATIN_GEOMETRY_LINEAR) { /* search parameters of rigid links, before operators are built */
    PetscCall(LatinSetProblem_Private(snes->latin, ts ? ts->step : state.structure, NULL));
    if (head.tuning > 0.0) PetscCall(LatinParameterRestore_Private(snes->latin, (PetscReal)head.tuning, (PetscReal)head.rigid_scale));
  }
  PetscCall(SNESSetUp(state.snes));
  PetscCall(LatinStateStructure_Private(&state, &structure));
  PetscCheck(head.structure == structure, comm, PETSC_ERR_FILE_UNEXPECTED, "The state %s is of another structure, partition or method: give the same scene and the same options", file);
  if (snes && snes->large.frame && !ts && !snes->large.path.solution) PetscCall(VecDuplicate(u, &snes->large.path.solution));
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
  LatinStateSave - Writes the state of a solver, from which another run continues to the bit.

  Collective on solver

  Input Parameters:
+ solver - a SNES of any type after a solve, or a TS of type latin after a step
. u      - the solution of the SNES; NULL for a TS
. file   - its name: HDF5 if it ends in .h5 or .hdf5, else PETSc's binary format; an older file is replaced atomically and keeps its mode
. n      - length of the note
- note   - bytes of the caller, from the first rank

  Level: intermediate

  Note:
  Loads, initial elongations and prescribed displacements are not written, as the caller sets them; positions of supports in a
  motion are. A symbolic link is followed: its target is replaced. Raises an error on all ranks, and changes no file, if the
  name is that of a folder, a named pipe, a socket or a device, if its folder does not exist or is not writable, if the disk is
  full, or while another run writes the same state.

.seealso: `LatinStateLoad()`, `SNESLatinSetWarmStart()`
@*/
PetscErrorCode LatinStateSave(PetscObject solver, Vec u, const char file[], PetscInt n, const char note[])
{
  PetscFunctionBegin;
  PetscValidHeader(solver, 1);
  PetscAssertPointer(file, 3);
  LatinWatch(PetscObjectComm(solver), LatinStateSave_Private(solver, u, file, n, note));
  PetscFunctionReturn(0);
}

/*@C
  LatinStateLoad - Reads a state of `LatinStateSave()`, for the same structure, options and number of ranks.

  Collective on solver

  Input Parameters:
+ solver - a SNES with its structure and options, or a TS of type latin with structure, options and solution
. u      - the solution of the SNES, overwritten; NULL for a TS
- file   - name of the file

  Output Parameters:
+ n    - length of the note
- note - the bytes of the caller and a terminating zero, on all ranks; free with PetscFree()

  Level: intermediate

  Note:
  With a warm start, the next solve of SNES latin continues from the state. A TS continues after the saved step.

.seealso: `LatinStateSave()`, `SNESLatinSetWarmStart()`
@*/
PetscErrorCode LatinStateLoad(PetscObject solver, Vec u, const char file[], PetscInt *n, char *note[])
{
  PetscFunctionBegin;
  PetscValidHeader(solver, 1);
  PetscAssertPointer(file, 3);
  PetscAssertPointer(n, 4);
  PetscAssertPointer(note, 5);
  LatinWatch(PetscObjectComm(solver), LatinStateLoad_Private(solver, u, file, n, note));
  PetscFunctionReturn(0);
}
