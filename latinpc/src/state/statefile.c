#if defined(LATIN_HDF5)
  #include <petsc/private/viewerhdf5impl.h>
#endif
#include "state/stateimpl.h"
#include <errno.h>

/*
   The file of a state: a header of 512 bytes of text, with a checksum of all bytes; the items, as a PETSc viewer writes them, in its binary format or in
   HDF5 (which finds its superblock at offset 512); the note of the caller.

   Only the first rank reads and writes; its errors are raised on all ranks.
*/

#define LATIN_STATE_FORMAT 9     /* version of the format; others are refused */
#define LATIN_STATE_HEAD   512   /* bytes of the header */
#define LATIN_STATE_CHUNK  65536 /* bytes read at once */

/* Names of the members of LatinStateHead */
static const char *const LatinStateNames[] = {"latinpc_state", "integer_bytes", "real_bytes", "ranks", "motion", "structure", "note_bytes", "time", "time_step", "shift", "tuning", "rigid_scale", "steps", "started", "solutions", "hdf5", "sum"};
#define LATIN_STATE_LINES ((int)PETSC_STATIC_ARRAY_LENGTH(LatinStateNames))

/* Prints a header */
static void LatinStatePrint(const LatinStateHead *head, char text[LATIN_STATE_HEAD])
{
  const double *value = (const double *)head;
  int           n     = 0;

  memset(text, 0, LATIN_STATE_HEAD);
  for (int i = 0; i < LATIN_STATE_LINES; i++) n += snprintf(text + n, (size_t)(LATIN_STATE_HEAD - n), "%s %.17g\n", LatinStateNames[i], value[i]);
}

/* Parses a header; returns the number of valid lines */
static int LatinStateScan(const char *text, LatinStateHead *head)
{
  double *value = (double *)head;
  char    name[32];
  int     used;

  for (int i = 0; i < LATIN_STATE_LINES; i++) {
    if (sscanf(text, "%31s %lf%n", name, &value[i], &used) != 2 || strcmp(name, LatinStateNames[i])) return i;
    text += used;
  }
  return LATIN_STATE_LINES;
}

/* Returns the checksum of the header, with sum 0, and of all bytes after it */
static double LatinStateSum(FILE *stream, const LatinStateHead *head)
{
  LatinStateHead whole = *head;
  char           chunk[LATIN_STATE_CHUNK];
  uint64_t       hash;

  whole.sum = 0.0;
  LatinStatePrint(&whole, chunk);
  hash = LatinStateHash(0, LATIN_STATE_HEAD, chunk);
  (void)fseek(stream, LATIN_STATE_HEAD, SEEK_SET);
  for (size_t n; (n = fread(chunk, 1, sizeof(chunk), stream));) hash = LatinStateHash(hash, n, chunk);
  return (double)hash;
}

/*
   Opens an HDF5 file in memory, for writing or with the content of `file` for reading. LatinHDF5Write_Private() writes it to disk: HDF5 cannot close a
   file after a write error, so on a full disk the program would crash at its end.
*/
static PetscErrorCode LatinHDF5Open_Private(PetscViewer viewer, const char file[], const LatinStateHead *head, PetscBool load)
{
#if defined(LATIN_HDF5)
  const double *value  = (const double *)head;
  hid_t         access = H5Pcreate(H5P_FILE_ACCESS), id = -1;

  PetscFunctionBegin;
  PetscCall(PetscViewerSetType(viewer, PETSCVIEWERHDF5));
  PetscCall(PetscViewerFileSetMode(viewer, load ? FILE_MODE_READ : FILE_MODE_WRITE));
  if (H5Pset_fapl_core(access, LATIN_STATE_CHUNK, 0) >= 0) id = load ? H5Fopen(file, H5F_ACC_RDONLY, access) : H5Fcreate(file, H5F_ACC_TRUNC, H5P_DEFAULT, access);
  (void)H5Pclose(access);
  PetscCheck(id >= 0, PETSC_COMM_SELF, PETSC_ERR_LIB, "HDF5 cannot open it");
  ((PetscViewer_HDF5 *)viewer->data)->file_id = id;
  if (load) PetscFunctionReturn(0);
  /* all but hdf5 and sum */
  for (int i = 0; i < LATIN_STATE_LINES - 2; i++) PetscCall(PetscViewerHDF5WriteAttribute(viewer, "/", LatinStateNames[i], PETSC_DOUBLE, &value[i]));
  PetscCall(PetscViewerHDF5WriteGroup(viewer, "/nodes"));
  PetscCall(PetscViewerHDF5WriteGroup(viewer, "/links"));
  PetscFunctionReturn(0);
#else
  SETERRQ(PETSC_COMM_SELF, PETSC_ERR_SUP, "This PETSc is without HDF5: %s", load ? "use the PETSc that wrote the state" : "give a name that does not end in .h5 or .hdf5");
#endif
}

/* Writes the HDF5 file in memory to disk, behind the header. Not collective */
static PetscErrorCode LatinHDF5Write_Private(PetscViewer viewer, const char file[])
{
#if defined(LATIN_HDF5)
  const hid_t id = ((PetscViewer_HDF5 *)viewer->data)->file_id;
  ssize_t     n  = H5Fflush(id, H5F_SCOPE_GLOBAL) < 0 ? -1 : H5Fget_file_image(id, NULL, 0);
  FILE       *stream;
  char       *bytes;
  PetscBool   done;

  PetscFunctionBegin;
  PetscCheck(n > 0, PETSC_COMM_SELF, PETSC_ERR_LIB, "Error of HDF5");
  PetscCall(PetscMalloc1(n, &bytes));
  PetscCheck(H5Fget_file_image(id, bytes, (size_t)n) == n, PETSC_COMM_SELF, PETSC_ERR_LIB, "Error of HDF5");
  stream = fopen(file, "wb");
  done   = (PetscBool)(stream && !fseek(stream, LATIN_STATE_HEAD, SEEK_SET) && fwrite(bytes, 1, (size_t)n, stream) == (size_t)n);
  done   = (PetscBool)(stream && !fclose(stream) && done);
  PetscCall(PetscFree(bytes));
  PetscCheck(done, PETSC_COMM_SELF, PETSC_ERR_FILE_WRITE, "%s", strerror(errno));
  PetscFunctionReturn(0);
#else
  return (PetscErrorCode)0;
#endif
}

/* Opens a viewer for the items: of a new file, or to read, behind the header. Not collective */
static PetscErrorCode LatinStateOpen_Private(const char file[], const LatinStateHead *head, PetscBool load, PetscViewer *viewer)
{
  char room[LATIN_STATE_HEAD] = "";

  PetscFunctionBegin;
  PetscCall(PetscViewerCreate(PETSC_COMM_SELF, viewer)); /* options are not read: -viewer_hdf5_sp_output would drop bits */
  if (head->hdf5 != 0.0) {
    PetscCall(LatinHDF5Open_Private(*viewer, file, head, load));
    PetscFunctionReturn(0);
  }
  PetscCall(PetscViewerSetType(*viewer, PETSCVIEWERBINARY));
  PetscCall(PetscViewerBinarySetSkipInfo(*viewer, PETSC_TRUE));
  PetscCall(PetscViewerFileSetMode(*viewer, load ? FILE_MODE_READ : FILE_MODE_WRITE));
  PetscCall(PetscViewerFileSetName(*viewer, file));
  if (load) PetscCall(PetscViewerBinaryRead(*viewer, room, LATIN_STATE_HEAD, NULL, PETSC_CHAR));
  else PetscCall(PetscViewerBinaryWrite(*viewer, room, LATIN_STATE_HEAD, PETSC_CHAR));
  PetscFunctionReturn(0);
}

/* Writes the entries of a vector as integers. Not collective */
static PetscErrorCode LatinStateViewIntegers_Private(Vec whole, PetscViewer viewer)
{
  const PetscScalar *a;
  PetscInt          *number, n, width;
  IS                 is;

  PetscFunctionBegin;
  PetscCall(VecGetLocalSize(whole, &n));
  PetscCall(VecGetBlockSize(whole, &width));
  PetscCall(PetscMalloc1(n, &number));
  PetscCall(VecGetArrayRead(whole, &a));
  for (PetscInt i = 0; i < n; i++) number[i] = (PetscInt)a[i];
  PetscCall(VecRestoreArrayRead(whole, &a));
  PetscCall(ISCreateGeneral(PETSC_COMM_SELF, n, number, PETSC_OWN_POINTER, &is));
  PetscCall(ISSetBlockSize(is, width));
  PetscCall(PetscObjectSetName((PetscObject)is, ((PetscObject)whole)->name));
  PetscCall(ISView(is, viewer));
  PetscCall(ISDestroy(&is));
  PetscFunctionReturn(0);
}

/*
   Writes the items to the new file `out`, or reads them from `file` if out is NULL; destroys them. Returns an error of the first rank there only.
   Collective on comm
*/
static PetscErrorCode LatinStateMove_Private(MPI_Comm comm, const char file[], LatinFile *out, const LatinStateHead *head, LatinState *state)
{
  const PetscBool load   = (PetscBool)!out;
  PetscViewer     viewer = NULL;
  PetscMPIInt     rank;
  PetscErrorCode  ierr = (PetscErrorCode)0, last;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  if (rank == 0 && out) ierr = LatinFileBegin_Private(file, out);
  if (rank == 0 && !ierr) ierr = LatinStateOpen_Private(out ? out->temporary : file, head, load, &viewer);
  for (PetscInt k = 0; k < state->items; k++) {
    Vec        v = state->item[k].v, whole;
    VecScatter gather;
    PetscInt   width;

    PetscCall(VecScatterCreateToZero(v, &gather, &whole));
    PetscCall(VecGetBlockSize(v, &width));
    if (rank == 0) PetscCall(VecSetBlockSize(whole, width)); /* width of the HDF5 dataset */
    PetscCall(PetscObjectSetName((PetscObject)whole, state->item[k].name));
    if (load && rank == 0 && !ierr) ierr = VecLoad(whole, viewer);
    PetscCall(VecScatterBegin(gather, load ? whole : v, load ? v : whole, INSERT_VALUES, load ? SCATTER_REVERSE : SCATTER_FORWARD));
    PetscCall(VecScatterEnd(gather, load ? whole : v, load ? v : whole, INSERT_VALUES, load ? SCATTER_REVERSE : SCATTER_FORWARD));
    if (!load && rank == 0 && !ierr) ierr = k < state->reals ? VecView(whole, viewer) : LatinStateViewIntegers_Private(whole, viewer);
    PetscCall(VecScatterDestroy(&gather));
    PetscCall(VecDestroy(&whole));
    PetscCall(VecDestroy(&state->item[k].v));
  }
  if (viewer && head->hdf5 != 0.0 && !load && !ierr) ierr = LatinHDF5Write_Private(viewer, out->temporary);
  last = PetscViewerDestroy(&viewer);
  PetscFunctionReturn(ierr ? ierr : last);
}

/* LatinStateMove_Private(), which raises an error of the first rank on all. Collective on comm */
PetscErrorCode LatinStateTransfer_Private(MPI_Comm comm, const char file[], LatinFile *out, const LatinStateHead *head, LatinState *state)
{
  PetscErrorCode ierr;

  PetscFunctionBegin;
  PetscCall(PetscPushErrorHandler(PetscReturnErrorHandler, NULL));
  ierr = LatinStateMove_Private(comm, file, out, head, state);
  PetscCall(PetscPopErrorHandler());
  LatinEach(comm, ierr);
  PetscFunctionReturn(0);
}

/* Appends the note, then writes the header with the checksum. Not collective */
static PetscErrorCode LatinStateSeal_Private(FILE *stream, LatinStateHead *head, const char note[])
{
  const size_t n = (size_t)head->note_bytes;
  char         text[LATIN_STATE_HEAD];
  PetscBool    done;

  PetscFunctionBegin;
  done      = (PetscBool)(!fseek(stream, 0, SEEK_END) && fwrite(note, 1, n, stream) == n && !fflush(stream));
  head->sum = done ? LatinStateSum(stream, head) : 0.0;
  LatinStatePrint(head, text);
  done = (PetscBool)(done && !ferror(stream) && !fseek(stream, 0, SEEK_SET) && fwrite(text, sizeof(text), 1, stream) == 1);
  PetscCheck(done, PETSC_COMM_SELF, PETSC_ERR_FILE_WRITE, "%s", strerror(errno));
  PetscFunctionReturn(0);
}

/* Writes a state to a file, in place of an older one if all is written. Sets format, sizes and checksum of head. Collective on comm */
PetscErrorCode LatinStateWrite_Private(MPI_Comm comm, const char file[], LatinStateHead *head, LatinState *state, const char note[])
{
  LatinFile      out     = {0};
  char          *message = NULL;
  PetscErrorCode ierr, last;

  PetscFunctionBegin;
  head->format        = LATIN_STATE_FORMAT;
  head->integer_bytes = sizeof(PetscInt);
  head->real_bytes    = sizeof(PetscReal);
  PetscCall(PetscPushErrorHandler(PetscReturnErrorHandler, NULL)); /* PETSc's own handler would let ranks sleep that are needed below */
  ierr = LatinStateTransfer_Private(comm, file, &out, head, state);
  if (!ierr && out.stream) ierr = LatinStateSeal_Private(out.stream, head, note);
  last = LatinFileEnd_Private(&out, (PetscBool)!ierr);
  PetscCall(PetscPopErrorHandler());
  if (!ierr) ierr = last;
  if (ierr) PetscCall(PetscErrorMessage(ierr, NULL, (void *)&message)); /* a char *, const in some versions of PETSc */
  LatinAgree(comm, ierr, PETSC_ERR_FILE_WRITE, "The state %s cannot be written, an older one is unchanged: %s%s", file, message ? message : "unknown", ierr == PETSC_ERR_FILE_OPEN ? "" : "; check the free space of its disk");
  PetscFunctionReturn(0);
}

/* Reads header and note of a file; an error unless this PETSc can read it and its checksum is right. Not collective */
static PetscErrorCode LatinStateLook_Private(const char file[], LatinStateHead *head, char **note)
{
  mode_t      mode;
  const char *why                        = LatinFileRefused(file, &mode);
  char        text[LATIN_STATE_HEAD + 1] = "";
  PetscBool   whole;
  FILE       *stream;
  int         lines;

  PetscFunctionBegin;
  PetscCheck(!why, PETSC_COMM_SELF, PETSC_ERR_FILE_OPEN, "The state %s cannot be read: %s", file, why);
  stream = fopen(file, "rb");
  PetscCheck(stream, PETSC_COMM_SELF, PETSC_ERR_FILE_OPEN, "The state %s cannot be read: %s", file, strerror(errno));
  (void)!fread(text, 1, LATIN_STATE_HEAD, stream); /* a short file is found below, by its lines or its checksum */
  lines = LatinStateScan(text, head);
  whole = (PetscBool)(lines == LATIN_STATE_LINES && LatinStateSum(stream, head) == head->sum);
  if (whole) PetscCall(PetscCalloc1((size_t)head->note_bytes + 1, note));
  if (whole) (void)!(fseek(stream, -(long)head->note_bytes, SEEK_END) || fread(*note, 1, (size_t)head->note_bytes, stream));
  (void)fclose(stream);
  PetscCheck(lines, PETSC_COMM_SELF, PETSC_ERR_FILE_UNEXPECTED, "%s is no state of latinpc: give the file that was written by --checkpoint or LatinStateSave()", file);
  PetscCheck(head->format == LATIN_STATE_FORMAT, PETSC_COMM_SELF, PETSC_ERR_FILE_UNEXPECTED, "The state %s has format %d, and this version of latinpc reads format %d: use the version that wrote it", file, (int)head->format, LATIN_STATE_FORMAT);
  PetscCheck(lines < LATIN_STATE_LINES || (head->integer_bytes == sizeof(PetscInt) && head->real_bytes == sizeof(PetscReal)), PETSC_COMM_SELF, PETSC_ERR_FILE_UNEXPECTED,
             "The state %s is of a PETSc with integers of %d bytes and reals of %d bytes, and this one has %d and %d: use the PETSc that wrote it", file, (int)head->integer_bytes, (int)head->real_bytes, (int)sizeof(PetscInt), (int)sizeof(PetscReal));
  PetscCheck(whole, PETSC_COMM_SELF, PETSC_ERR_FILE_UNEXPECTED, "The state %s is not whole, or has been damaged or changed: take an older one, or start anew", file);
  PetscFunctionReturn(0);
}

/* Reads header and note of a file on all ranks; the caller frees *note. Collective on comm */
PetscErrorCode LatinStateReadHead_Private(MPI_Comm comm, const char file[], LatinStateHead *head, char **note)
{
  PetscMPIInt rank;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  LatinEach(comm, rank ? (PetscErrorCode)0 : LatinStateLook_Private(file, head, note));
  PetscCallMPI(MPI_Bcast(head, (PetscMPIInt)sizeof(*head), MPI_BYTE, 0, comm));
  if (rank) PetscCall(PetscCalloc1((size_t)head->note_bytes + 1, note));
  PetscCallMPI(MPI_Bcast(*note, (PetscMPIInt)head->note_bytes, MPI_CHAR, 0, comm));
  PetscFunctionReturn(0);
}
