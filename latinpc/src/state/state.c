#include "state/stateimpl.h"
#include <petsc/private/snesimpl.h>
#include <petsc/private/tsimpl.h>

/*
   What a run needs to go on to the bit where another one has ended: the displacements, for a motion the velocities and
   the time and the strains that the last step started from, and of SNES latin what a warm start takes up: the
   fixed-point unknowns of the last two solves, the displacements and forces that linear stages add to, the tensions of
   rigid links. Everything else is computed anew from the structure and the options.
*/

/* Where the next n numbers of this rank are, NULL while they are counted */
static PetscErrorCode LatinPackPart_Private(LatinPack *pack, const char name[], PetscInt n, PetscInt width, PetscReal **mine)
{
  LatinPart *part = &pack->part[pack->parts++];

  PetscFunctionBegin;
  PetscAssert(pack->parts <= LATIN_STATE_PARTS, PETSC_COMM_SELF, PETSC_ERR_PLIB, "More parts than LATIN_STATE_PARTS");
  *mine         = pack->data ? pack->data + pack->n : NULL;
  part->name    = name;
  part->n       = n;
  part->width   = width;
  part->integer = PETSC_FALSE;
  pack->n += n;
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinPackReals_Private(LatinPack *pack, const char name[], PetscInt n, PetscReal x[])
{
  PetscReal *mine;

  PetscFunctionBegin;
  PetscCall(LatinPackPart_Private(pack, name, n, 1, &mine));
  if (mine && pack->load) PetscCall(PetscArraycpy(x, mine, n));
  else if (mine) PetscCall(PetscArraycpy(mine, x, n));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinPackVec_Private(LatinPack *pack, const char name[], Vec v)
{
  PetscScalar       *a;
  const PetscScalar *b;
  PetscInt           n;

  PetscFunctionBegin;
  PetscCall(VecGetLocalSize(v, &n));
  if (pack->data && pack->load) {
    PetscCall(VecGetArrayWrite(v, &a));
    PetscCall(LatinPackReals_Private(pack, name, n, a));
    PetscCall(VecRestoreArrayWrite(v, &a));
  } else {
    PetscCall(VecGetArrayRead(v, &b)); /* a monitor may not write */
    PetscCall(LatinPackReals_Private(pack, name, n, (PetscReal *)b));
    PetscCall(VecRestoreArrayRead(v, &b));
  }
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinPackSNES_Private(LatinPack *pack, SNES snes, LatinStateHead *head)
{
  SNES_Latin *data  = (SNES_Latin *)snes->data;
  Latin       latin = data->latin;

  PetscFunctionBegin;
  PetscCall(LatinPackVec_Private(pack, "fixed_point", data->z));
  if (!data->z_before) PetscCall(VecDuplicate(data->z, &data->z_before));
  PetscCall(LatinPackVec_Private(pack, "fixed_point_before", data->z_before));
  PetscCall(LatinPackReals_Private(pack, "subdomain_displacement", latin->sub.bs * latin->sub.copies, latin->linear.U));
  PetscCall(LatinPackReals_Private(pack, "interface_pull", latin->inter.sides, latin->linear.pull));
  PetscCall(LatinPackReals_Private(pack, "subdomain_tension", latin->linear.tension ? latin->sub.nonsmooth : 0, latin->linear.tension));
  PetscCall(LatinPackReals_Private(pack, "rigid_tension", latin->linear.rigid_tension ? latin->sub.structure->links_local : 0, latin->linear.rigid_tension));
  if (pack->data && pack->load) {
    data->has_state  = (PetscBool)(head->solutions > 0);
    data->has_before = (PetscBool)(head->solutions > 1);
  } else if (pack->data) head->solutions = data->has_state ? (data->has_before ? 2 : 1) : 0;
  PetscFunctionReturn(0);
}

/* The SNES of a motion is that of its steps, and the vector its displacements */
typedef struct {
  SNES           snes;
  TS             ts; /* NULL in statics */
  Vec            u;
  LatinStructure structure;
  PetscBool      latin; /* the SNES is of type latin */
} LatinStateOf;

static PetscErrorCode LatinPackTS_Private(LatinPack *pack, TS ts, LatinStateHead *head)
{
  TS_Latin *data = (TS_Latin *)ts->data;

  PetscFunctionBegin;
  PetscCall(LatinPackVec_Private(pack, "velocity", ts->vec_dot));
  PetscCall(LatinPackVec_Private(pack, "increment", data->w));
  PetscCall(LatinPackReals_Private(pack, "initial_elongation", data->step->links_local, data->step->e0)); /* tensions are those of the step */
  if (pack->data && pack->load) {
    data->started = (PetscBool)(head->started != 0);
    ts->ptime     = (PetscReal)head->time;
    ts->time_step = (PetscReal)head->time_step;
    PetscCall(TSSetStepNumber(ts, (PetscInt)head->steps));
  } else if (pack->data) {
    head->started   = data->started;
    head->time      = (double)ts->ptime;
    head->time_step = (double)ts->time_step;
    head->steps     = (long)ts->steps;
  }
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinPack_Private(LatinPack *pack, LatinStateOf *of, LatinStateHead *head)
{
  PetscFunctionBegin;
  pack->n = pack->parts = 0;
  PetscCall(LatinPackVec_Private(pack, "displacement", of->u));
  if (of->ts) PetscCall(LatinPackTS_Private(pack, of->ts, head));
  if (of->latin) PetscCall(LatinPackSNES_Private(pack, of->snes, head));
  PetscFunctionReturn(0);
}

/* What those look for who open a state in HDF5, in the caller's numbering; it is not read. Collective */
static PetscErrorCode LatinPackShow_Private(LatinPack *show, LatinStateOf *of)
{
  const LatinStructure structure = of->structure;
  const TS_Latin      *data      = of->ts ? (TS_Latin *)of->ts->data : NULL;
  const PetscInt       n = structure->nodes_local * structure->dim, m = structure->links_local;
  PetscReal           *mine;

  PetscFunctionBegin;
  show->n = show->parts = 0;
  PetscCall(LatinPackPart_Private(show, "/nodes/coordinates", n, structure->dim, &mine));
  if (mine) PetscCall(PetscArraycpy(mine, structure->x, n));
  PetscCall(LatinPackPart_Private(show, "/nodes/displacement", n, structure->dim, &mine));
  if (mine) PetscCall(LatinStructureGetDisplacements(structure, of->u, mine));
  if (of->ts) {
    PetscCall(LatinPackPart_Private(show, "/nodes/velocity", n, structure->dim, &mine));
    if (mine) PetscCall(LatinStructureGetDisplacements(structure, of->ts->vec_dot, mine));
    for (PetscInt i = 0; mine && i < n; i++) mine[i] = structure->fixed[i] ? 0.0 : mine[i];
  }
  PetscCall(LatinPackPart_Private(show, "/links/tension", m, 1, &mine));
  if (mine) PetscCall(LatinSolverTensions_Private(of->snes, data ? data->step : structure, data ? data->w : of->u, mine));
  PetscCall(LatinPackPart_Private(show, "/links/nodes", 2 * m, 2, &mine));
  for (PetscInt i = 0; mine && i < 2 * m; i++) mine[i] = (PetscReal)structure->nodes[i];
  show->part[show->parts - 1].integer = PETSC_TRUE;
  PetscFunctionReturn(0);
}

/* The structure without loads and initial elongations, which may change from one solve to the next; its partition, its interfaces and the search direction. Collective */
static PetscErrorCode LatinStateStructure_Private(LatinStateOf *of, uint64_t *all)
{
  const LatinStructure structure = of->structure;
  const size_t         n = (size_t)structure->nodes_local, m = (size_t)structure->links_local, dim = (size_t)structure->dim;
  const MPI_Comm       comm = PetscObjectComm((PetscObject)of->snes);
  PetscMPIInt          size;
  uint64_t             hash = (uint64_t)dim, *each;

  PetscFunctionBegin;
  LatinStateHash(&hash, n * dim * sizeof(PetscReal), structure->x);
  LatinStateHash(&hash, n * dim * sizeof(PetscBool), structure->fixed);
  LatinStateHash(&hash, n * sizeof(PetscReal), of->ts ? structure->mass : NULL);
  LatinStateHash(&hash, 2 * m * sizeof(PetscInt), structure->nodes);
  LatinStateHash(&hash, m * sizeof(PetscInt), structure->law);
  LatinStateHash(&hash, m * sizeof(PetscReal), structure->stiffness);
  LatinStateHash(&hash, m * sizeof(PetscReal), structure->friction);
  LatinStateHash(&hash, m * dim * sizeof(PetscReal), structure->direction);
  if (of->latin) {
    const Latin latin = ((SNES_Latin *)of->snes->data)->latin;

    LatinStateHash(&hash, (size_t)latin->sub.copies * sizeof(PetscInt), latin->sub.node);
    LatinStateHash(&hash, (size_t)latin->sub.links * 2 * sizeof(PetscInt), latin->sub.ends);
    LatinStateHash(&hash, (size_t)latin->inter.sides * sizeof(PetscInt), latin->inter.side_dof);
    LatinStateHash(&hash, (size_t)latin->inter.sides * sizeof(PetscReal), latin->dir.d);
  }
  PetscCallMPI(MPI_Comm_size(comm, &size));
  PetscCall(PetscMalloc1(size, &each));
  PetscCallMPI(MPI_Allgather(&hash, 1, MPI_UINT64_T, each, 1, MPI_UINT64_T, comm));
  *all = LatinHash((size_t)size * sizeof(*each), each);
  PetscCall(PetscFree(each));
  PetscFunctionReturn(0);
}

/* The parts of a solver that a state is made of. Collective on solver */
static PetscErrorCode LatinStateOf_Private(PetscObject solver, Vec u, LatinStateOf *of)
{
  MPI_Comm  comm = PetscObjectComm(solver);
  PetscBool latin;

  PetscFunctionBegin;
  PetscCall(PetscMemzero(of, sizeof(*of)));
  PetscCheck(solver->classid == TS_CLASSID || solver->classid == SNES_CLASSID, comm, PETSC_ERR_ARG_WRONG, "The state of a SNES or a TS can be kept, not that of a %s", solver->class_name);
  if (solver->classid == TS_CLASSID) {
    of->ts = (TS)solver;
    PetscCall(PetscObjectTypeCompare(solver, TSLATIN, &latin));
    PetscCheck(latin, comm, PETSC_ERR_ARG_WRONG, "The state of a TS can be kept when it is of type latin, not %s: use -ts_type latin", solver->type_name ? solver->type_name : "unknown");
    PetscCall(TSGetSNES(of->ts, &of->snes));
  } else of->snes = (SNES)solver;
  if (of->ts) PetscCall(TSSetUp(of->ts));
  of->u = of->ts ? of->ts->vec_sol : u;
  PetscCheck(of->u, comm, PETSC_ERR_ARG_NULL, "The state of a SNES goes with its solution: give the vector");
  if (of->ts) of->structure = ((TS_Latin *)of->ts->data)->step->base;
  else PetscCall(SNESLatinFindStructure_Private(of->snes, &of->structure));
  PetscCheck(of->structure, comm, PETSC_ERR_ORDER, "The solver has no structure: give it one with LatinStructureAttachSNES()");
  PetscCall(LatinStructureCheckVec_Private(of->structure, of->u));
  PetscCall(PetscObjectTypeCompare((PetscObject)of->snes, SNESLATIN, &of->latin));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinStateSave_Private(PetscObject solver, Vec u, const char file[], PetscInt n, const char note[])
{
  MPI_Comm       comm = PetscObjectComm(solver);
  LatinStateHead head;
  PetscMPIInt    ranks;
  LatinStateOf   of;
  LatinPack      pack = {.data = NULL, .load = PETSC_FALSE}, show = pack;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(comm, &ranks));
  PetscCall(LatinStateOf_Private(solver, u, &of));
  PetscCheck(!of.latin || ((SNES_Latin *)of.snes->data)->z, comm, PETSC_ERR_ORDER, "There is no state yet: solve, or make a step, before");
  PetscCall(PetscMemzero(&head, sizeof(head)));
  PetscCall(LatinStateFormat_Private(comm, file, &head));
  PetscCall(LatinStateStructure_Private(&of, &head.structure));
  head.tuning     = of.latin ? (double)((SNES_Latin *)of.snes->data)->latin->tuning : 1.0;
  head.ranks      = (long)ranks;
  head.motion     = of.ts ? 1 : 0;
  head.shift      = of.ts ? (double)((TS_Latin *)of.ts->data)->step->shift : 0.0;
  head.note_bytes = (long)n;
  PetscCall(LatinPack_Private(&pack, &of, &head));
  PetscCall(PetscMalloc1(pack.n + 1, &pack.data)); /* never NULL */
  PetscCall(LatinPack_Private(&pack, &of, &head));
  if (head.hdf5) {
    PetscCall(LatinPackShow_Private(&show, &of));
    PetscCall(PetscMalloc1(show.n + 1, &show.data));
    PetscCall(LatinPackShow_Private(&show, &of));
  }
  PetscCall(LatinStateWrite_Private(comm, file, &head, &pack, &show, (char *)note));
  PetscCall(PetscFree(show.data));
  PetscCall(PetscFree(pack.data));
  PetscFunctionReturn(0);
}

/* The search parameters of rigid links that the solves before have found, before anything is built with others. Collective on the SNES */
static PetscErrorCode LatinStateTune_Private(const LatinStateOf *of, PetscReal tuning)
{
  LatinStructure structure;
  Latin          latin;

  PetscFunctionBegin;
  if (!of->latin) PetscFunctionReturn(0);
  latin = ((SNES_Latin *)of->snes->data)->latin;
  PetscCall(SNESLatinFindStructure_Private(of->snes, &structure));
  PetscCall(LatinSetStructure_Private(latin, structure));
  if (tuning > 0.0 && tuning != latin->tuning) PetscCall(LatinParameterTune_Private(latin, tuning / latin->tuning));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinStateLoad_Private(PetscObject solver, Vec u, const char file[], PetscInt *n, char **note)
{
  MPI_Comm       comm = PetscObjectComm(solver);
  LatinPack      pack = {.data = NULL, .load = PETSC_TRUE};
  uint64_t       structure;
  PetscInt       total;
  PetscMPIInt    ranks;
  LatinStateHead head;
  LatinStateOf   of;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(comm, &ranks));
  PetscCall(LatinStateReadHead_Private(comm, file, &head));
  PetscCall(LatinStateOf_Private(solver, u, &of));
  PetscCheck(head.ranks == (long)ranks, comm, PETSC_ERR_FILE_UNEXPECTED, "The state %s is of %ld ranks, and these are %d: run on %ld", file, head.ranks, (int)ranks, head.ranks);
  PetscCheck(head.motion == (of.ts ? 1 : 0), comm, PETSC_ERR_FILE_UNEXPECTED, "The state %s is that of %s", file, head.motion ? "a motion: give the number of time steps" : "a solve, not of a motion: leave out the time steps");
  if (of.ts) PetscCall(LatinStepLength_Private(((TS_Latin *)of.ts->data)->step, (PetscReal)head.shift));
  PetscCall(LatinStateTune_Private(&of, (PetscReal)head.tuning));
  PetscCall(SNESSetUp(of.snes));
  PetscCall(LatinPack_Private(&pack, &of, &head));
  PetscCall(LatinStateStructure_Private(&of, &structure));
  PetscCall(MPIU_Allreduce(&pack.n, &total, 1, MPIU_INT, MPI_SUM, comm));
  PetscCheck(head.structure == structure && head.numbers == (long)total, comm, PETSC_ERR_FILE_UNEXPECTED, "The state %s is of another structure, partition or method: give the same scene and the same options", file);
  *n = (PetscInt)head.note_bytes;
  PetscCall(PetscCalloc1(*n + 1, note));
  PetscCall(PetscMalloc1(pack.n + 1, &pack.data)); /* never NULL */
  PetscCall(LatinStateRead_Private(comm, file, &head, &pack, *note));
  PetscCall(LatinPack_Private(&pack, &of, &head));
  PetscCall(PetscFree(pack.data));
  PetscFunctionReturn(0);
}

/*@C
  LatinStateSave - Writes what a solver needs to go on to the bit in another run.

  Collective on solver

  Input Parameters:
+ solver - a SNES, of type latin or another one, after a solve; or a TS of type latin, after a step
. u      - the solution of the SNES; NULL for a TS
. file   - name of the file, in a folder that can be written to, of HDF5 when it ends in .h5 or .hdf5, else of PETSc's
           binary format; an older state of this name is replaced in one step
. n      - length of the note
- note   - bytes of the caller's own, from the first rank

  Level: intermediate

  Note:
  Loads, initial elongations and prescribed displacements are not written: the caller has them.

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
  The next solve of SNES latin goes on from the state when it starts warm. The next step of the TS is the one after
  the step that was saved.

.seealso: `LatinStateSave()`, `SNESLatinSetWarmStart()`
@*/
PetscErrorCode LatinStateLoad(PetscObject solver, Vec u, const char file[], PetscInt *n, char *note[])
{
  PetscFunctionBegin;
  PetscValidHeader(solver, 1);
  LatinWatch(PetscObjectComm(solver), LatinStateLoad_Private(solver, u, file, n, note));
  PetscFunctionReturn(0);
}
