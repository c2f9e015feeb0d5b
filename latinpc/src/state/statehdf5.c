#if defined(LATIN_HDF5)
  #include <petsc/private/viewerhdf5impl.h>
#endif
#include "state/stateimpl.h"
#include <errno.h>
#include <inttypes.h>

/*
   States in HDF5: what all ranks have in common as attributes, each part and the note as a dataset.

   PETSc's viewer is given a file in memory, and the bytes go to and from the disk here. HDF5 cannot give up a file that
   it fails to write: the program would crash at its end, long after the error of a full disk. Nor does HDF5 keep sums: of
   damaged bytes it makes other numbers, so that it is shown none before state/statefile.c has found their sum right.
*/

#if defined(LATIN_HDF5)

  #define LATIN_HDF5_GROWTH 1048576 /* bytes by which the memory grows */

/* HDF5 writes of its errors itself, unless told not to; PETSc's errors are enough */
static void LatinHDF5Silence(PetscBool silent)
{
  static H5E_auto2_t speak   = NULL;
  static void       *context = NULL;

  if (silent) (void)H5Eget_auto2(H5E_DEFAULT, &speak, &context);
  (void)H5Eset_auto2(H5E_DEFAULT, silent ? NULL : speak, silent ? NULL : context);
}

static PetscErrorCode LatinHDF5Attributes_Private(PetscViewer viewer, const LatinStateHead *head)
{
  PetscFunctionBegin;
  for (const LatinStateLine *line = LatinStateLines; line->at != offsetof(LatinStateHead, bytes); line++) { /* the rest is of the file */
    const void *at       = (const char *)head + line->at;
    char        text[32] = "";

    if (line->kind == LATIN_LINE_INTEGER) PetscCall(PetscViewerHDF5WriteAttribute(viewer, "/", line->name, PETSC_LONG, at));
    else if (line->kind == LATIN_LINE_REAL) PetscCall(PetscViewerHDF5WriteAttribute(viewer, "/", line->name, PETSC_DOUBLE, at));
    else {
      PetscCall(PetscSNPrintf(text, sizeof(text), "%016" PRIx64, *(const uint64_t *)at));
      PetscCall(PetscViewerHDF5WriteAttribute(viewer, "/", line->name, PETSC_STRING, text));
    }
  }
  PetscFunctionReturn(0);
}

/* The bytes of a file that are HDF5's; HDF5 copies them */
static PetscErrorCode LatinHDF5Read_Private(const char file[], size_t n, hid_t access)
{
  FILE     *stream = fopen(file, "rb");
  char     *bytes;
  PetscBool done;

  PetscFunctionBegin;
  PetscCheck(stream, PETSC_COMM_SELF, PETSC_ERR_FILE_OPEN, "%s", strerror(errno));
  PetscCall(PetscMalloc1(n, &bytes));
  done = (PetscBool)(fread(bytes, 1, n, stream) == n);
  (void)fclose(stream);
  PetscCheck(done, PETSC_COMM_SELF, PETSC_ERR_FILE_READ, "It ends early");
  PetscCheck(H5Pset_file_image(access, bytes, n) >= 0, PETSC_COMM_SELF, PETSC_ERR_MEM, "No memory for HDF5");
  PetscCall(PetscFree(bytes));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinHDF5Open_Private(const char file[], const LatinStateHead *head, PetscBool load, PetscViewer *viewer)
{
  char  name[PETSC_MAX_PATH_LEN + 8];
  hid_t access, id;

  PetscFunctionBegin;
  LatinHDF5Silence(PETSC_TRUE);
  PetscCall(PetscViewerCreate(PETSC_COMM_SELF, viewer));
  PetscCall(PetscViewerSetType(*viewer, PETSCVIEWERHDF5)); /* without its options: -viewer_hdf5_sp_output takes bits away */
  PetscCall(PetscViewerFileSetMode(*viewer, load ? FILE_MODE_READ : FILE_MODE_WRITE));
  access = H5Pcreate(H5P_FILE_ACCESS);
  PetscCheck(H5Pset_fapl_core(access, LATIN_HDF5_GROWTH, 0) >= 0, PETSC_COMM_SELF, PETSC_ERR_LIB, "HDF5 has no files in memory");
  if (load) PetscCall(LatinHDF5Read_Private(file, (size_t)head->bytes - LATIN_STATE_HEAD, access));
  PetscCall(PetscSNPrintf(name, sizeof(name), "%s/memory", file)); /* a file on the disk may not have it, and none can */
  id = load ? H5Fopen(name, H5F_ACC_RDONLY, access) : H5Fcreate(name, H5F_ACC_TRUNC, H5P_DEFAULT, access);
  (void)H5Pclose(access);
  PetscCheck(id >= 0, PETSC_COMM_SELF, PETSC_ERR_LIB, "HDF5 cannot open it");
  ((PetscViewer_HDF5 *)(*viewer)->data)->file_id = id;
  if (load) PetscFunctionReturn(0);
  PetscCall(LatinHDF5Attributes_Private(*viewer, head));
  PetscCall(PetscViewerHDF5WriteGroup(*viewer, "/nodes"));
  PetscCall(PetscViewerHDF5WriteGroup(*viewer, "/links"));
  PetscFunctionReturn(0);
}

/* As a dataset: attributes are of at most 64 kB */
static PetscErrorCode LatinHDF5Note_Private(PetscViewer viewer, PetscBool load, PetscInt n, char note[])
{
  hid_t     file, type, space, dataset;
  PetscBool done;

  PetscFunctionBegin;
  if (!n) PetscFunctionReturn(0); /* HDF5 has no strings without letters */
  PetscCall(PetscViewerHDF5GetFileId(viewer, &file));
  type  = H5Tcopy(H5T_C_S1);
  space = H5Screate(H5S_SCALAR);
  done  = (PetscBool)(H5Tset_size(type, (size_t)n) >= 0 && H5Tset_strpad(type, H5T_STR_NULLPAD) >= 0);
  if (load) dataset = H5Dopen2(file, "note", H5P_DEFAULT);
  else dataset = H5Dcreate2(file, "note", type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  if (load) done = (PetscBool)(done && H5Dread(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, note) >= 0);
  else done = (PetscBool)(done && H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, note) >= 0);
  (void)H5Dclose(dataset);
  (void)H5Sclose(space);
  (void)H5Tclose(type);
  PetscCheck(done, PETSC_COMM_SELF, PETSC_ERR_LIB, "Error of HDF5 in the note");
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinHDF5Write_Private(PetscViewer viewer, const char file[])
{
  FILE     *stream;
  char     *bytes;
  hid_t     id;
  ssize_t   n;
  PetscBool done;

  PetscFunctionBegin;
  PetscCall(PetscViewerHDF5GetFileId(viewer, &id));
  PetscCheck(H5Fflush(id, H5F_SCOPE_GLOBAL) >= 0, PETSC_COMM_SELF, PETSC_ERR_LIB, "Error of HDF5");
  n = H5Fget_file_image(id, NULL, 0);
  PetscCheck(n > 0, PETSC_COMM_SELF, PETSC_ERR_LIB, "Error of HDF5");
  PetscCall(PetscMalloc1(n, &bytes));
  PetscCheck(H5Fget_file_image(id, bytes, (size_t)n) == n, PETSC_COMM_SELF, PETSC_ERR_LIB, "Error of HDF5");
  stream = fopen(file, "wb");
  done   = (PetscBool)(stream && fwrite(bytes, 1, (size_t)n, stream) == (size_t)n);
  done   = (PetscBool)(stream && !fclose(stream) && done);
  PetscCall(PetscFree(bytes));
  PetscCheck(done, PETSC_COMM_SELF, PETSC_ERR_FILE_WRITE, "%s", strerror(errno));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinHDF5Close_Private(PetscViewer *viewer, const char file[])
{
  PetscErrorCode ierr = (PetscErrorCode)0;

  PetscFunctionBegin;
  if (file) ierr = LatinHDF5Write_Private(*viewer, file);
  PetscCall(PetscViewerDestroy(viewer));
  LatinHDF5Silence(PETSC_FALSE);
  PetscCall(ierr);
  PetscFunctionReturn(0);
}

static const LatinStateFormat format         = {LatinHDF5Open_Private, LatinHDF5Note_Private, LatinHDF5Close_Private};
const LatinStateFormat *const LatinStateHDF5 = &format;

#else

const LatinStateFormat *const LatinStateHDF5 = NULL;

#endif
