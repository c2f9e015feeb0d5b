#include "state/stateimpl.h"
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <sys/stat.h>
#include <unistd.h>

/*
   The file of a state: each part as a Vec of all ranks, then the caller's note, written by a viewer of PETSc's, and a
   head of plain text with a sum of all bytes. In PETSc's binary format the head is in front; in HDF5, for names that end
   in .h5 or .hdf5, it is what follows the end of HDF5's own bytes, where HDF5 does not look.

   Only the first rank reads and writes: an error there is its own, and the others hear of it. The file takes the place of
   an older one in one step, when all of it is on the disk.
*/

#define LATIN_STATE_FORMAT 3
#define LATIN_STATE_CHUNK  1048576

#define LATIN_LINE(kind, member) {#member, LATIN_LINE_##kind, offsetof(LatinStateHead, member)}
const LatinStateLine LatinStateLines[] = {
  {"latinpc_state", LATIN_LINE_INTEGER, offsetof(LatinStateHead, format)},
  LATIN_LINE(INTEGER, integer_bytes),
  LATIN_LINE(INTEGER, real_bytes),
  LATIN_LINE(INTEGER, ranks),
  LATIN_LINE(INTEGER, motion),
  LATIN_LINE(HASH, structure),
  LATIN_LINE(INTEGER, numbers),
  LATIN_LINE(INTEGER, note_bytes),
  LATIN_LINE(REAL, time),
  LATIN_LINE(REAL, time_step),
  LATIN_LINE(REAL, shift),
  LATIN_LINE(REAL, tuning),
  LATIN_LINE(INTEGER, steps),
  LATIN_LINE(INTEGER, started),
  LATIN_LINE(INTEGER, solutions),
  LATIN_LINE(INTEGER, bytes),
  LATIN_LINE(HASH, sum),
};
#define LATIN_LINES ((int)(sizeof(LatinStateLines) / sizeof(LatinStateLines[0])))

static void LatinStatePrintHead(const LatinStateHead *head, char text[LATIN_STATE_HEAD])
{
  int n = 0;

  memset(text, 0, LATIN_STATE_HEAD);
  for (int i = 0; i < LATIN_LINES; i++) {
    const LatinStateLine *line = &LatinStateLines[i];
    const void           *at   = (const char *)head + line->at;
    char                 *to   = text + n;
    const size_t          room = (size_t)(LATIN_STATE_HEAD - n);

    if (line->kind == LATIN_LINE_INTEGER) n += snprintf(to, room, "%s %ld\n", line->name, *(const long *)at);
    else if (line->kind == LATIN_LINE_REAL) n += snprintf(to, room, "%s %.17g\n", line->name, *(const double *)at);
    else n += snprintf(to, room, "%s %016" PRIx64 "\n", line->name, *(const uint64_t *)at);
  }
}

/* How many of its lines a head has */
static int LatinStateScanHead(const char text[LATIN_STATE_HEAD + 1], LatinStateHead *head)
{
  for (int i = 0; i < LATIN_LINES; i++) {
    const LatinStateLine *line     = &LatinStateLines[i];
    void                 *at       = (char *)head + line->at;
    char                  name[32] = "";
    int                   used     = 0, found;

    if (sscanf(text, "%31s%n", name, &used) != 1 || strcmp(name, line->name)) return i;
    text += used;
    if (line->kind == LATIN_LINE_INTEGER) found = sscanf(text, "%ld%n", (long *)at, &used);
    else if (line->kind == LATIN_LINE_REAL) found = sscanf(text, "%lf%n", (double *)at, &used);
    else found = sscanf(text, "%" SCNx64 "%n", (uint64_t *)at, &used);
    if (found != 1) return i;
    text += used;
  }
  return LATIN_LINES;
}

/* Of the head and of the bytes that it is the head of */
static PetscErrorCode LatinStateSum_Private(FILE *stream, const LatinStateHead *head, uint64_t *sum)
{
  LatinStateHead whole = *head;
  char           text[LATIN_STATE_HEAD], *chunk;
  size_t         got, left = (size_t)head->bytes - LATIN_STATE_HEAD;

  PetscFunctionBegin;
  whole.sum = 0;
  LatinStatePrintHead(&whole, text);
  *sum = LatinHash(sizeof(text), text);
  PetscCall(PetscMalloc1(LATIN_STATE_CHUNK, &chunk));
  PetscCheck(!fseek(stream, head->hdf5 ? 0 : LATIN_STATE_HEAD, SEEK_SET), PETSC_COMM_SELF, PETSC_ERR_FILE_READ, "%s", strerror(errno));
  for (; left; left -= got) {
    got = fread(chunk, 1, PetscMin(left, LATIN_STATE_CHUNK), stream);
    PetscCheck(got, PETSC_COMM_SELF, PETSC_ERR_FILE_READ, "%s", ferror(stream) ? strerror(errno) : "it ends early");
    LatinStateHash(sum, got, chunk);
  }
  PetscCall(PetscFree(chunk));
  PetscFunctionReturn(0);
}

/* ---- PETSc's binary format, of one rank ---- */

static PetscErrorCode LatinBinaryOpen_Private(const char file[], const LatinStateHead *head, PetscBool load, PetscViewer *viewer)
{
  char text[LATIN_STATE_HEAD] = "";

  PetscFunctionBegin;
  PetscCall(PetscViewerCreate(PETSC_COMM_SELF, viewer));
  PetscCall(PetscViewerSetType(*viewer, PETSCVIEWERBINARY));
  PetscCall(PetscViewerBinarySetSkipInfo(*viewer, PETSC_TRUE));
  PetscCall(PetscViewerFileSetMode(*viewer, load ? FILE_MODE_READ : FILE_MODE_WRITE));
  PetscCall(PetscViewerFileSetName(*viewer, file));
  if (load) PetscCall(PetscViewerBinaryRead(*viewer, text, LATIN_STATE_HEAD, NULL, PETSC_CHAR));
  else PetscCall(PetscViewerBinaryWrite(*viewer, text, LATIN_STATE_HEAD, PETSC_CHAR)); /* its place */
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinBinaryNote_Private(PetscViewer viewer, PetscBool load, PetscInt n, char note[])
{
  PetscFunctionBegin;
  if (load) PetscCall(PetscViewerBinaryRead(viewer, note, n, NULL, PETSC_CHAR));
  else PetscCall(PetscViewerBinaryWrite(viewer, note, n, PETSC_CHAR));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinBinaryClose_Private(PetscViewer *viewer, const char file[])
{
  PetscFunctionBegin;
  PetscCall(PetscViewerDestroy(viewer));
  PetscFunctionReturn(0);
}

static const LatinStateFormat binary = {LatinBinaryOpen_Private, LatinBinaryNote_Private, LatinBinaryClose_Private};

/* ---- a viewer, the same way for both formats and both directions ---- */

static PetscErrorCode LatinStateView_Private(Vec whole, const LatinPart *part, PetscViewer viewer)
{
  const PetscScalar *a;
  PetscInt          *number, n;
  IS                 is;

  PetscFunctionBegin;
  if (!part->integer) {
    PetscCall(VecView(whole, viewer));
    PetscFunctionReturn(0);
  }
  PetscCall(VecGetLocalSize(whole, &n));
  PetscCall(PetscMalloc1(n, &number));
  PetscCall(VecGetArrayRead(whole, &a));
  for (PetscInt i = 0; i < n; i++) number[i] = (PetscInt)a[i];
  PetscCall(VecRestoreArrayRead(whole, &a));
  PetscCall(ISCreateGeneral(PETSC_COMM_SELF, n, number, PETSC_OWN_POINTER, &is));
  PetscCall(ISSetBlockSize(is, part->width));
  PetscCall(PetscObjectSetName((PetscObject)is, part->name));
  PetscCall(ISView(is, viewer));
  PetscCall(ISDestroy(&is));
  PetscFunctionReturn(0);
}

/* The numbers of all ranks, one rank after the other; the first one has the viewer. Collective on comm */
static PetscErrorCode LatinStatePart_Private(MPI_Comm comm, PetscViewer viewer, const LatinPart *part, PetscReal mine[], PetscBool load)
{
  Vec        each, whole;
  VecScatter gather;

  PetscFunctionBegin;
  PetscCall(VecCreateMPIWithArray(comm, part->width, part->n, PETSC_DETERMINE, mine, &each));
  PetscCall(VecScatterCreateToZero(each, &gather, &whole));
  PetscCall(VecSetBlockSize(whole, part->width));
  PetscCall(PetscObjectSetName((PetscObject)whole, part->name));
  if (load) {
    LatinEach(comm, viewer ? VecLoad(whole, viewer) : (PetscErrorCode)0);
    PetscCall(VecScatterBegin(gather, whole, each, INSERT_VALUES, SCATTER_REVERSE));
    PetscCall(VecScatterEnd(gather, whole, each, INSERT_VALUES, SCATTER_REVERSE));
  } else {
    PetscCall(VecScatterBegin(gather, each, whole, INSERT_VALUES, SCATTER_FORWARD));
    PetscCall(VecScatterEnd(gather, each, whole, INSERT_VALUES, SCATTER_FORWARD));
    LatinEach(comm, viewer ? LatinStateView_Private(whole, part, viewer) : (PetscErrorCode)0);
  }
  PetscCall(VecScatterDestroy(&gather));
  PetscCall(VecDestroy(&whole));
  PetscCall(VecDestroy(&each));
  PetscFunctionReturn(0);
}

/* Collective on comm */
static PetscErrorCode LatinStateParts_Private(MPI_Comm comm, PetscViewer viewer, const LatinPack *pack)
{
  PetscInt done = 0;

  PetscFunctionBegin;
  for (PetscInt k = 0; k < pack->parts; k++) {
    PetscCall(LatinStatePart_Private(comm, viewer, &pack->part[k], pack->data + done, pack->load));
    done += pack->part[k].n;
  }
  PetscFunctionReturn(0);
}

/* Collective on comm */
static PetscErrorCode LatinStateTransfer_Private(MPI_Comm comm, const char file[], const LatinStateHead *head, const LatinPack *state, const LatinPack *show, char note[])
{
  const LatinStateFormat *format = head->hdf5 ? LatinStateHDF5 : &binary;
  PetscViewer             viewer = NULL;
  PetscMPIInt             rank;
  PetscErrorCode          ierr, last = (PetscErrorCode)0;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  ierr = LatinAgreeError_Private(comm, rank ? (PetscErrorCode)0 : format->open(file, head, state->load, &viewer));
  if (!ierr) ierr = LatinStateParts_Private(comm, viewer, state);
  if (!ierr && show) ierr = LatinStateParts_Private(comm, viewer, show);
  if (!ierr && viewer) ierr = format->note(viewer, state->load, (PetscInt)head->note_bytes, note);
  if (viewer) last = format->close(&viewer, ierr || state->load ? NULL : file);
  PetscCall(LatinAgreeError_Private(comm, ierr ? ierr : last));
  PetscFunctionReturn(0);
}

/* ---- writing ---- */

/* Whoever looks finds the old state or the new one, whole. Of one rank */
static PetscErrorCode LatinStateSeal_Private(const char temporary[], const char file[], LatinStateHead *head)
{
  char           text[LATIN_STATE_HEAD], folder[PETSC_MAX_PATH_LEN];
  const char    *slash = strrchr(file, '/');
  int            descriptor;
  struct stat    status;
  FILE          *stream = fopen(temporary, "r+b");
  PetscBool      done;
  PetscErrorCode ierr;

  PetscFunctionBegin;
  PetscCheck(stream && !fstat(fileno(stream), &status), PETSC_COMM_SELF, PETSC_ERR_FILE_WRITE, "%s", strerror(errno));
  head->bytes = (long)status.st_size + (head->hdf5 ? LATIN_STATE_HEAD : 0);
  ierr        = LatinStateSum_Private(stream, head, &head->sum);
  if (ierr) (void)fclose(stream);
  PetscCall(ierr);
  LatinStatePrintHead(head, text);
  done = (PetscBool)(!fseek(stream, head->hdf5 ? head->bytes - LATIN_STATE_HEAD : 0, SEEK_SET) && fwrite(text, sizeof(text), 1, stream) == 1);
  done = (PetscBool)(done && !fflush(stream) && !fsync(fileno(stream)));
  done = (PetscBool)(!fclose(stream) && done && !rename(temporary, file));
  PetscCheck(done, PETSC_COMM_SELF, PETSC_ERR_FILE_WRITE, "%s", strerror(errno));
  PetscCall(PetscStrncpy(folder, file, sizeof(folder)));
  folder[slash ? slash - file + 1 : 0] = 0;
  descriptor                           = open(slash ? folder : ".", O_RDONLY);
  if (descriptor < 0) PetscFunctionReturn(0); /* a folder that cannot be opened cannot be waited for */
  (void)fsync(descriptor);
  (void)close(descriptor);
  PetscFunctionReturn(0);
}

/* The system's own words, before a library finds other ones. Of one rank */
static PetscErrorCode LatinStateTouch_Private(const char temporary[])
{
  int descriptor;

  PetscFunctionBegin;
  descriptor = open(temporary, O_WRONLY | O_CREAT | O_TRUNC, 0666);
  PetscCheck(descriptor >= 0 && !close(descriptor), PETSC_COMM_SELF, PETSC_ERR_FILE_OPEN, "%s", strerror(errno));
  PetscFunctionReturn(0);
}

/* The format that the name of a file asks for. Collective on comm */
PetscErrorCode LatinStateFormat_Private(MPI_Comm comm, const char file[], LatinStateHead *head)
{
  PetscBool is[2];

  PetscFunctionBegin;
  PetscCall(PetscStrendswith(file, ".h5", &is[0]));
  PetscCall(PetscStrendswith(file, ".hdf5", &is[1]));
  head->hdf5 = is[0] || is[1];
  PetscCheck(!head->hdf5 || LatinStateHDF5, comm, PETSC_ERR_SUP, "The state %s would be of HDF5, which this PETSc is without: give a name that does not end in .h5 or .hdf5", file);
  PetscFunctionReturn(0);
}

/* Fills in what the head says of the file. Collective on comm */
PetscErrorCode LatinStateWrite_Private(MPI_Comm comm, const char file[], LatinStateHead *head, LatinPack *state, LatinPack *show, char note[])
{
  char           temporary[PETSC_MAX_PATH_LEN + 8], *message = NULL; /* a name cut short might be that of the file */
  PetscInt       total;
  PetscMPIInt    rank;
  PetscErrorCode ierr;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  PetscCall(MPIU_Allreduce(&state->n, &total, 1, MPIU_INT, MPI_SUM, comm));
  head->format        = LATIN_STATE_FORMAT;
  head->integer_bytes = (long)sizeof(PetscInt);
  head->real_bytes    = (long)sizeof(PetscReal);
  head->numbers       = (long)total;
  PetscCall(PetscSNPrintf(temporary, sizeof(temporary), "%s.part", file));
  ierr = LatinAgreeError_Private(comm, rank ? (PetscErrorCode)0 : LatinStateTouch_Private(temporary));
  if (!ierr) ierr = LatinStateTransfer_Private(comm, temporary, head, state, show, note);
  if (!ierr && !rank) ierr = LatinStateSeal_Private(temporary, file, head);
  if (ierr) PetscCall(PetscErrorMessage(ierr, NULL, (void *)&message)); /* char *, const or not, by version */
  if (ierr && !rank) (void)unlink(temporary);
  LatinAgree(comm, ierr, PETSC_ERR_FILE_WRITE, "The state %s cannot be written, an older one stays: see that its folder is there, may be written to and has room (%s)", file, message ? message : "unknown");
  PetscFunctionReturn(0);
}

/* ---- reading ---- */

/* Returns what is wrong, a whole head or nothing at all. Of one rank */
static PetscErrorCode LatinStateLook_Private(const char file[], LatinStateHead *head, char wrong[], size_t room)
{
  static const char signature[]                = "\211HDF\r\n\032\n";
  char              text[LATIN_STATE_HEAD + 1] = "";
  struct stat       status;
  FILE             *stream = fopen(file, "rb");
  int               found;

  PetscFunctionBegin;
  if (!stream || fstat(fileno(stream), &status)) PetscCall(PetscSNPrintf(wrong, room, "The state %s cannot be read: %s", file, strerror(errno)));
  else {
    (void)!fread(text, 1, LATIN_STATE_HEAD, stream); /* what is missing will be missed */
    head->hdf5 = !memcmp(text, signature, sizeof(signature) - 1);
    if (head->hdf5) (void)!(fseek(stream, -LATIN_STATE_HEAD, SEEK_END) || fread(text, 1, LATIN_STATE_HEAD, stream));
    found = LatinStateScanHead(text, head);
    if (!found && head->hdf5) PetscCall(PetscSNPrintf(wrong, room, "The file %s of HDF5 is not whole, has been changed, or is no state of latinpc: take an older one, or start anew", file));
    else if (!found) PetscCall(PetscSNPrintf(wrong, room, "%s is no state of latinpc: give the file that was written by --checkpoint or LatinStateSave()", file));
    else if (head->format != LATIN_STATE_FORMAT) PetscCall(PetscSNPrintf(wrong, room, "The state %s has format %ld, and this version of latinpc reads format %d: go on with the version that wrote it", file, head->format, LATIN_STATE_FORMAT));
    else if (found < LATIN_LINES || head->bytes != (long)status.st_size || head->bytes < LATIN_STATE_HEAD || head->numbers < 0 || head->note_bytes < 0 || head->note_bytes > head->bytes)
      PetscCall(PetscSNPrintf(wrong, room, "The state %s is not whole: take an older one, or start anew", file));
  }
  if (stream) (void)fclose(stream);
  PetscFunctionReturn(0);
}

/* The head, of a file that this PETSc can read as far as the head says. Collective on comm */
PetscErrorCode LatinStateReadHead_Private(MPI_Comm comm, const char file[], LatinStateHead *head)
{
  char        wrong[512] = "";
  PetscMPIInt rank;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  PetscCall(PetscMemzero(head, sizeof(*head)));
  if (rank == 0) PetscCall(LatinStateLook_Private(file, head, wrong, sizeof(wrong)));
  LatinAgree(comm, wrong[0], PETSC_ERR_FILE_UNEXPECTED, "%s", wrong);
  PetscCallMPI(MPI_Bcast(head, (PetscMPIInt)sizeof(*head), MPI_BYTE, 0, comm));
  PetscCheck(!head->hdf5 || LatinStateHDF5, comm, PETSC_ERR_SUP, "The state %s is of HDF5, which this PETSc is without: go on with the PETSc that wrote it", file);
  PetscCheck(head->integer_bytes == (long)sizeof(PetscInt), comm, PETSC_ERR_FILE_UNEXPECTED, "The state %s is of a PETSc with integers of %ld bytes, and this one has %d: go on with the PETSc that wrote it", file, head->integer_bytes,
             (int)sizeof(PetscInt));
  PetscCheck(head->real_bytes == (long)sizeof(PetscReal), comm, PETSC_ERR_FILE_UNEXPECTED, "The state %s is of a PETSc with reals of %ld bytes, and this one has %d: go on with the PETSc that wrote it", file, head->real_bytes, (int)sizeof(PetscReal));
  PetscFunctionReturn(0);
}

/* Are the bytes those that have been written? Of one rank */
static PetscErrorCode LatinStateCheck_Private(const char file[], const LatinStateHead *head)
{
  FILE          *stream = fopen(file, "rb");
  uint64_t       sum    = 0;
  PetscErrorCode ierr;

  PetscFunctionBegin;
  PetscCheck(stream, PETSC_COMM_SELF, PETSC_ERR_FILE_OPEN, "The state %s cannot be read: %s", file, strerror(errno));
  ierr = LatinStateSum_Private(stream, head, &sum);
  (void)fclose(stream);
  PetscCall(ierr);
  PetscCheck(sum == head->sum, PETSC_COMM_SELF, PETSC_ERR_FILE_UNEXPECTED, "The state %s has been damaged: take an older one, or start anew", file);
  PetscFunctionReturn(0);
}

/* Collective on comm */
PetscErrorCode LatinStateRead_Private(MPI_Comm comm, const char file[], LatinStateHead *head, LatinPack *pack, char note[])
{
  PetscMPIInt rank;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  LatinEach(comm, rank ? (PetscErrorCode)0 : LatinStateCheck_Private(file, head));
  PetscCall(LatinStateTransfer_Private(comm, file, head, pack, NULL, note));
  PetscCallMPI(MPI_Bcast(note, (PetscMPIInt)head->note_bytes, MPI_CHAR, 0, comm));
  PetscFunctionReturn(0);
}
