#include "sneslatinimpl.h"
#include <errno.h>
#include <fcntl.h>
#include <petsc/private/snesimpl.h>
#include <petsc/private/tsimpl.h>
#include <sys/stat.h>
#include <unistd.h>

/*
   What a run needs to go on to the bit where another one has ended: the displacements, for a motion the velocities and
   the time and the strains that the last step started from, and of SNES latin what a warm start takes up: the
   fixed-point unknowns of the last two solves, the displacements and forces that linear stages add to, the tensions of
   rigid links. Everything else is computed anew from the structure and the options.

   The file is of PETSc's binary format, after a head of plain text: the numbers of each rank one after the other as a
   Vec, then the bytes of the caller's note. It takes the place of an older one in one step, when all of it is on the disk.
*/

#define LATIN_STATE_FORMAT 2
#define LATIN_STATE_HEAD   512
#define LATIN_STATE_MAGIC  "latinpc state"

typedef struct {
  int                format, integer, ranks, motion;
  long long          reals, note, bytes;
  unsigned long long structure, sum;
  double             shift; /* 1 / h^2 of a motion */
} LatinStateHead;

/* The numbers of this rank, counted, gathered or handed out, always in the same order */
typedef struct {
  PetscReal *data; /* NULL: count */
  PetscInt   n;
  PetscBool  load;
} LatinPack;

static PetscErrorCode LatinPackReals_Private(LatinPack *pack, PetscInt n, PetscReal x[])
{
  PetscFunctionBegin;
  if (pack->data && pack->load) PetscCall(PetscArraycpy(x, pack->data + pack->n, n));
  else if (pack->data) PetscCall(PetscArraycpy(pack->data + pack->n, x, n));
  pack->n += n;
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinPackVec_Private(LatinPack *pack, Vec v)
{
  PetscScalar       *a;
  const PetscScalar *b;
  PetscInt           n;

  PetscFunctionBegin;
  PetscCall(VecGetLocalSize(v, &n));
  if (pack->data && pack->load) {
    PetscCall(VecGetArrayWrite(v, &a));
    PetscCall(LatinPackReals_Private(pack, n, a));
    PetscCall(VecRestoreArrayWrite(v, &a));
  } else {
    PetscCall(VecGetArrayRead(v, &b)); /* a monitor may not write */
    PetscCall(LatinPackReals_Private(pack, n, (PetscReal *)b));
    PetscCall(VecRestoreArrayRead(v, &b));
  }
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinPackBool_Private(LatinPack *pack, PetscBool *flag)
{
  PetscReal value = *flag ? 1.0 : 0.0;

  PetscFunctionBegin;
  PetscCall(LatinPackReals_Private(pack, 1, &value));
  if (pack->load && pack->data) *flag = (PetscBool)(value != 0.0);
  PetscFunctionReturn(0);
}

/* Which links were slack when local fields were made: those are made anew. Collective */
static PetscErrorCode LatinPackFloppy_Private(LatinPack *pack, Latin latin)
{
  PetscBool known = latin->floppy.known;

  PetscFunctionBegin;
  if (!latin->local_slack) PetscFunctionReturn(0);
  PetscCall(LatinPackBool_Private(pack, &known));
  if (pack->load && pack->data && known && !latin->floppy.known) PetscCall(PetscCalloc1(latin->sub.links, &latin->floppy.slack));
  for (PetscInt l = 0; l < latin->sub.links; l++) {
    PetscBool none = PETSC_FALSE;

    PetscCall(LatinPackBool_Private(pack, known ? &latin->floppy.slack[l] : &none));
  }
  if (!pack->load || !pack->data || !known) PetscFunctionReturn(0);
  latin->floppy.known = PETSC_TRUE;
  PetscCall(LatinAdapt_Private(latin));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinPackSNES_Private(LatinPack *pack, SNES snes)
{
  SNES_Latin *data  = (SNES_Latin *)snes->data;
  Latin       latin = data->latin;

  PetscFunctionBegin;
  PetscCall(LatinPackFloppy_Private(pack, latin));
  PetscCall(LatinPackBool_Private(pack, &data->has_state));
  PetscCall(LatinPackBool_Private(pack, &data->has_before));
  PetscCall(LatinPackVec_Private(pack, data->z));
  if (!data->z_before) PetscCall(VecDuplicate(data->z, &data->z_before));
  PetscCall(LatinPackVec_Private(pack, data->z_before));
  PetscCall(LatinPackReals_Private(pack, latin->sub.bs * latin->sub.copies, latin->linear.U));
  PetscCall(LatinPackReals_Private(pack, latin->inter.sides, latin->linear.pull));
  if (latin->sub.tension) PetscCall(LatinPackReals_Private(pack, latin->sub.nonsmooth, latin->sub.tension));
  if (latin->links->multiplier) PetscCall(LatinPackReals_Private(pack, latin->links->links_local, latin->links->multiplier));
  PetscFunctionReturn(0);
}

/* The SNES of a motion is that of its steps, and the vector its displacements */
typedef struct {
  SNES       snes;
  TS         ts; /* NULL in statics */
  Vec        u;
  LatinLinks links;
  PetscBool  latin; /* the SNES is of type latin */
} LatinStateOf;

static PetscErrorCode LatinPackTS_Private(LatinPack *pack, TS ts)
{
  TS_Latin *data  = (TS_Latin *)ts->data;
  PetscReal steps = (PetscReal)ts->steps;

  PetscFunctionBegin;
  PetscCall(LatinPackVec_Private(pack, ts->vec_dot));
  PetscCall(LatinPackVec_Private(pack, data->w));
  PetscCall(LatinPackReals_Private(pack, data->step->links_local, data->step->prestrain)); /* tensions are those of the step */
  PetscCall(LatinPackBool_Private(pack, &data->started));
  PetscCall(LatinPackReals_Private(pack, 1, &ts->ptime));
  PetscCall(LatinPackReals_Private(pack, 1, &ts->time_step));
  PetscCall(LatinPackReals_Private(pack, 1, &steps));
  if (pack->load && pack->data) PetscCall(TSSetStepNumber(ts, (PetscInt)steps));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinPack_Private(LatinPack *pack, LatinStateOf *of)
{
  PetscFunctionBegin;
  pack->n = 0;
  PetscCall(LatinPackVec_Private(pack, of->u));
  if (of->ts) PetscCall(LatinPackTS_Private(pack, of->ts));
  if (of->latin) PetscCall(LatinPackSNES_Private(pack, of->snes));
  PetscFunctionReturn(0);
}

/* Adds what the numbers of a state depend on */
static void LatinStateHash(uint64_t *hash, size_t n, const void *data)
{
  uint64_t both[2] = {*hash, data ? LatinHash(n, data) : 0};

  *hash = LatinHash(sizeof(both), both);
}

/* One number for the bytes of all ranks, in the order of the ranks. Collective */
static PetscErrorCode LatinStateHashRanks_Private(MPI_Comm comm, uint64_t mine, unsigned long long *all)
{
  PetscMPIInt size;
  uint64_t   *each;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(comm, &size));
  PetscCall(PetscMalloc1(size, &each));
  PetscCallMPI(MPI_Allgather(&mine, 1, MPI_UINT64_T, each, 1, MPI_UINT64_T, comm));
  *all = (unsigned long long)LatinHash((size_t)size * sizeof(*each), each);
  PetscCall(PetscFree(each));
  PetscFunctionReturn(0);
}

/* The structure without loads and prestrains, which may change from one solve to the next; its partition, its interfaces and the search direction */
static PetscErrorCode LatinStateStructure_Private(LatinStateOf *of, unsigned long long *all)
{
  const LatinLinks links = of->links;
  const size_t     n = (size_t)links->nodes_local, m = (size_t)links->links_local, dim = (size_t)links->dim;
  uint64_t         hash = (uint64_t)dim;

  PetscFunctionBegin;
  LatinStateHash(&hash, n * dim * sizeof(PetscReal), links->x);
  LatinStateHash(&hash, n * dim * sizeof(PetscBool), links->fixed);
  LatinStateHash(&hash, n * sizeof(PetscReal), of->ts ? links->mass : NULL);
  LatinStateHash(&hash, 2 * m * sizeof(PetscInt), links->nodes);
  LatinStateHash(&hash, m * sizeof(PetscInt), links->law);
  LatinStateHash(&hash, m * sizeof(PetscReal), links->stiffness);
  LatinStateHash(&hash, m * sizeof(PetscReal), links->friction);
  LatinStateHash(&hash, m * dim * sizeof(PetscReal), links->direction);
  if (of->latin) {
    const Latin latin = ((SNES_Latin *)of->snes->data)->latin;

    LatinStateHash(&hash, (size_t)latin->sub.copies * sizeof(PetscInt), latin->sub.node);
    LatinStateHash(&hash, (size_t)latin->sub.links * 2 * sizeof(PetscInt), latin->sub.ends);
    LatinStateHash(&hash, (size_t)latin->inter.sides * sizeof(PetscInt), latin->inter.side_dof);
    LatinStateHash(&hash, (size_t)latin->inter.sides * sizeof(PetscReal), latin->macro.d);
  }
  PetscCall(LatinStateHashRanks_Private(PetscObjectComm((PetscObject)of->snes), hash, all));
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
  if (of->ts) of->links = ((TS_Latin *)of->ts->data)->step->base;
  else PetscCall(SNESLatinFindLinks_Private(of->snes, &of->links));
  PetscCheck(of->links, comm, PETSC_ERR_ORDER, "The solver has no structure: give it one with LatinLinksAttachSNES()");
  PetscCall(LatinLinksCheckVec_Private(of->links, of->u));
  PetscCall(PetscObjectTypeCompare((PetscObject)of->snes, SNESLATIN, &of->latin));
  PetscFunctionReturn(0);
}

/* ---- the file ---- */

/* Only the first rank reads and writes: an error there is its own, and the others hear of it */
static PetscErrorCode LatinStateViewer_Private(const char file[], PetscFileMode mode, PetscViewer *viewer)
{
  PetscFunctionBegin;
  PetscCall(PetscViewerCreate(PETSC_COMM_SELF, viewer));
  PetscCall(PetscViewerSetType(*viewer, PETSCVIEWERBINARY));
  PetscCall(PetscViewerBinarySetSkipInfo(*viewer, PETSC_TRUE));
  PetscCall(PetscViewerFileSetMode(*viewer, mode));
  PetscCall(PetscViewerFileSetName(*viewer, file));
  PetscFunctionReturn(0);
}

/* What has been written is on the disk, under its name: whoever looks finds the old state or the new one. Of one rank */
static PetscErrorCode LatinStateReplace_Private(const char temporary[], const char file[])
{
  char        folder[PETSC_MAX_PATH_LEN];
  const char *slash = strrchr(file, '/');
  int         descriptor;
  PetscBool   done;

  PetscFunctionBegin;
  descriptor = open(temporary, O_RDONLY);
  done       = (PetscBool)(descriptor >= 0 && !fsync(descriptor));
  if (descriptor >= 0) (void)close(descriptor);
  done = (PetscBool)(done && !rename(temporary, file));
  PetscCheck(done, PETSC_COMM_SELF, PETSC_ERR_FILE_WRITE, "The state %s cannot be written: %s", file, strerror(errno));
  PetscCall(PetscStrncpy(folder, file, sizeof(folder)));
  folder[slash ? slash - file + 1 : 0] = 0;
  descriptor                           = open(slash ? folder : ".", O_RDONLY);
  if (descriptor < 0) PetscFunctionReturn(0); /* a folder that cannot be opened cannot be waited for */
  (void)fsync(descriptor);
  (void)close(descriptor);
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinStateWrite_Private(const char file[], const char head[], Vec state, PetscInt n, const char note[])
{
  char           temporary[PETSC_MAX_PATH_LEN];
  PetscViewer    viewer;
  PetscErrorCode ierr;

  PetscFunctionBegin;
  PetscCall(PetscSNPrintf(temporary, sizeof(temporary), "%s.part", file));
  PetscCall(LatinStateViewer_Private(temporary, FILE_MODE_WRITE, &viewer));
  ierr = PetscViewerBinaryWrite(viewer, (void *)head, LATIN_STATE_HEAD, PETSC_CHAR);
  if (!ierr) ierr = VecView(state, viewer);
  if (!ierr) ierr = PetscViewerBinaryWrite(viewer, (void *)note, n, PETSC_CHAR);
  PetscCall(PetscViewerDestroy(&viewer));
  if (!ierr) ierr = LatinStateReplace_Private(temporary, file);
  if (ierr) (void)unlink(temporary);
  PetscCall(ierr);
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinStateSave_Private(PetscObject solver, Vec u, const char file[], PetscInt n, const char note[])
{
  MPI_Comm       comm                   = PetscObjectComm(solver);
  char           text[LATIN_STATE_HEAD] = "";
  LatinStateHead head;
  PetscReal     *data;
  PetscInt       total;
  PetscMPIInt    rank, ranks;
  LatinStateOf   of;
  LatinPack      pack = {NULL, 0, PETSC_FALSE};
  Vec            state, whole;
  VecScatter     gather;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  PetscCallMPI(MPI_Comm_size(comm, &ranks));
  PetscCall(LatinStateOf_Private(solver, u, &of));
  PetscCheck(!of.latin || ((SNES_Latin *)of.snes->data)->z, comm, PETSC_ERR_ORDER, "There is no state yet: solve, or make a step, before");
  PetscCall(LatinStateStructure_Private(&of, &head.structure));
  PetscCall(LatinPack_Private(&pack, &of));
  PetscCall(PetscMalloc1(pack.n, &data));
  pack.data = data;
  PetscCall(LatinPack_Private(&pack, &of));
  PetscCall(LatinStateHashRanks_Private(comm, LatinHash((size_t)pack.n * sizeof(*data), data), &head.sum));
  PetscCall(VecCreateMPIWithArray(comm, 1, pack.n, PETSC_DETERMINE, data, &state));
  PetscCall(VecGetSize(state, &total));
  head.format  = LATIN_STATE_FORMAT;
  head.integer = (int)sizeof(PetscInt);
  head.ranks   = (int)ranks;
  head.motion  = of.ts ? 1 : 0;
  head.shift   = of.ts ? (double)((TS_Latin *)of.ts->data)->step->shift : 0.0;
  head.reals   = (long long)total;
  head.note    = (long long)n;
  head.bytes   = (long long)(LATIN_STATE_HEAD + 2 * sizeof(PetscInt)) + head.reals * (long long)sizeof(PetscReal) + head.note;
  (void)snprintf(text, sizeof(text), LATIN_STATE_MAGIC " %d\nintegers %d\nranks %d\nmotion %d\nshift %a\nreals %lld\nnote %lld\nbytes %lld\nstructure %016llx\nsum %016llx\n", head.format, head.integer, head.ranks, head.motion, head.shift, head.reals,
                 head.note, head.bytes, head.structure, head.sum);
  PetscCall(VecScatterCreateToZero(state, &gather, &whole));
  PetscCall(VecScatterBegin(gather, state, whole, INSERT_VALUES, SCATTER_FORWARD));
  PetscCall(VecScatterEnd(gather, state, whole, INSERT_VALUES, SCATTER_FORWARD));
  LatinEach(comm, rank ? (PetscErrorCode)0 : LatinStateWrite_Private(file, text, whole, n, note));
  PetscCall(VecScatterDestroy(&gather));
  PetscCall(VecDestroy(&whole));
  PetscCall(VecDestroy(&state));
  PetscCall(PetscFree(data));
  PetscFunctionReturn(0);
}

/* The head of a file, read by the first rank; what it cannot read is in `wrong`. Collective on comm */
static PetscErrorCode LatinStateReadHead_Private(MPI_Comm comm, const char file[], LatinStateHead *head)
{
  char        text[LATIN_STATE_HEAD + 1] = "", wrong[512] = "";
  struct stat status;
  PetscMPIInt rank;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  PetscCall(PetscMemzero(head, sizeof(*head)));
  if (rank == 0) {
    FILE  *stream = fopen(file, "rb");
    size_t got    = stream ? fread(text, 1, LATIN_STATE_HEAD, stream) : 0;

    if (!stream || fstat(fileno(stream), &status)) PetscCall(PetscSNPrintf(wrong, sizeof(wrong), "The state %s cannot be read: %s", file, strerror(errno)));
    else if (sscanf(text, LATIN_STATE_MAGIC " %d", &head->format) != 1) PetscCall(PetscSNPrintf(wrong, sizeof(wrong), "%s is no state of latinpc: give the file that was written by --checkpoint or LatinStateSave()", file));
    else if (head->format != LATIN_STATE_FORMAT) PetscCall(PetscSNPrintf(wrong, sizeof(wrong), "The state %s has format %d, and this version of latinpc reads format %d: go on with the version that wrote it", file, head->format, LATIN_STATE_FORMAT));
    else if (got < LATIN_STATE_HEAD ||
             sscanf(text, LATIN_STATE_MAGIC " %d integers %d ranks %d motion %d shift %la reals %lld note %lld bytes %lld structure %llx sum %llx", &head->format, &head->integer, &head->ranks, &head->motion, &head->shift, &head->reals, &head->note,
                    &head->bytes, &head->structure, &head->sum) != 10 ||
             head->bytes != (long long)status.st_size || head->reals < 0 || head->note < 0 || head->note > head->bytes)
      PetscCall(PetscSNPrintf(wrong, sizeof(wrong), "The state %s is not whole: take an older one, or start anew", file));
    if (stream) (void)fclose(stream);
  }
  LatinAgree(comm, wrong[0], PETSC_ERR_FILE_UNEXPECTED, "%s", wrong);
  PetscCallMPI(MPI_Bcast(head, (PetscMPIInt)sizeof(*head), MPI_BYTE, 0, comm));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinStateRead_Private(const char file[], Vec state, PetscInt n, char note[])
{
  char        head[LATIN_STATE_HEAD];
  PetscViewer viewer;

  PetscFunctionBegin;
  PetscCall(LatinStateViewer_Private(file, FILE_MODE_READ, &viewer));
  PetscCall(PetscViewerBinaryRead(viewer, head, LATIN_STATE_HEAD, NULL, PETSC_CHAR));
  PetscCall(VecLoad(state, viewer));
  PetscCall(PetscViewerBinaryRead(viewer, note, n, NULL, PETSC_CHAR));
  PetscCall(PetscViewerDestroy(&viewer));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinStateLoad_Private(PetscObject solver, Vec u, const char file[], PetscInt *n, char **note)
{
  MPI_Comm           comm = PetscObjectComm(solver);
  LatinPack          pack = {NULL, 0, PETSC_TRUE};
  unsigned long long structure, sum;
  PetscReal         *data;
  PetscInt           total;
  PetscMPIInt        rank, ranks;
  LatinStateHead     head;
  LatinStateOf       of;
  Vec                state, whole;
  VecScatter         scatter;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  PetscCallMPI(MPI_Comm_size(comm, &ranks));
  PetscCall(LatinStateReadHead_Private(comm, file, &head));
  PetscCall(LatinStateOf_Private(solver, u, &of));
  PetscCheck(head.integer == (int)sizeof(PetscInt), comm, PETSC_ERR_FILE_UNEXPECTED, "The state %s is of a PETSc with integers of %d bytes, and this one has %d: go on with the PETSc that wrote it", file, head.integer, (int)sizeof(PetscInt));
  PetscCheck(head.ranks == (int)ranks, comm, PETSC_ERR_FILE_UNEXPECTED, "The state %s is of %d ranks, and these are %d: run on %d", file, head.ranks, (int)ranks, head.ranks);
  PetscCheck(head.motion == (of.ts ? 1 : 0), comm, PETSC_ERR_FILE_UNEXPECTED, "The state %s is that of %s", file, head.motion ? "a motion: give the number of time steps" : "a solve, not of a motion: leave out the time steps");
  if (of.ts) PetscCall(LatinStepLength_Private(((TS_Latin *)of.ts->data)->step, (PetscReal)head.shift));
  PetscCall(SNESSetUp(of.snes));
  PetscCall(LatinPack_Private(&pack, &of));
  PetscCall(LatinStateStructure_Private(&of, &structure));
  PetscCall(VecCreateMPI(comm, pack.n, PETSC_DETERMINE, &state));
  PetscCall(VecGetSize(state, &total));
  PetscCheck(head.structure == structure && head.reals == (long long)total, comm, PETSC_ERR_FILE_UNEXPECTED, "The state %s is of another structure, partition or method: give the same scene and the same options", file);
  *n = (PetscInt)head.note;
  PetscCall(PetscMalloc1(*n + 1, note));
  (*note)[*n] = 0;
  PetscCall(VecScatterCreateToZero(state, &scatter, &whole));
  LatinEach(comm, rank ? (PetscErrorCode)0 : LatinStateRead_Private(file, whole, *n, *note));
  PetscCallMPI(MPI_Bcast(*note, (PetscMPIInt)*n, MPI_CHAR, 0, comm));
  PetscCall(VecScatterBegin(scatter, whole, state, INSERT_VALUES, SCATTER_REVERSE));
  PetscCall(VecScatterEnd(scatter, whole, state, INSERT_VALUES, SCATTER_REVERSE));
  PetscCall(VecScatterDestroy(&scatter));
  PetscCall(VecDestroy(&whole));
  PetscCall(VecGetArray(state, &data));
  PetscCall(LatinStateHashRanks_Private(comm, LatinHash((size_t)pack.n * sizeof(*data), data), &sum));
  PetscCheck(sum == head.sum, comm, PETSC_ERR_FILE_UNEXPECTED, "The state %s has been damaged: take an older one, or start anew", file);
  pack.data = data;
  PetscCall(LatinPack_Private(&pack, &of));
  PetscCall(VecRestoreArray(state, &data));
  PetscCall(VecDestroy(&state));
  PetscFunctionReturn(0);
}

/*@C
  LatinStateSave - Writes what a solver needs to go on to the bit in another run.

  Collective on solver

  Input Parameters:
+ solver - a SNES, of type latin or another one, after a solve; or a TS of type latin, after a step
. u      - the solution of the SNES; NULL for a TS
. file   - name of the file, in a folder that can be written to; an older state of this name is replaced in one step
. n      - length of the note
- note   - bytes of the caller's own, from the first rank

  Level: intermediate

  Note:
  Loads, prestrains and prescribed displacements are not written: the caller knows them.

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
