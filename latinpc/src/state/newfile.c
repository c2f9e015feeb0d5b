#include "state/stateimpl.h"
#include <errno.h>
#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

/*
   Atomic replacement of a file once all of the new one is on disk; latinpc/results/atomic.py does the same for results. The new file is written in the
   same folder under a fixed temporary name: the next run overwrites the rest that a killed run leaves. A file lock, which the system removes from killed
   runs, excludes other runs. No function is collective.
*/

#define LATIN_FILE_LINKS 40  /* most symbolic links followed, as in Linux */
#define LATIN_FILE_NAME  200 /* most letters of the name in the temporary name; file systems allow 255 */

/* Returns why a file cannot be read or replaced, NULL: it can; *mode: its mode, 0: no such file. Opens nothing: opening a named pipe would block */
const char *LatinFileRefused(const char file[], mode_t *mode)
{
  struct stat found;
  size_t      n = strlen(file);

  *mode = 0;
  if (n > 3 && !strcmp(file + n - 3, ".gz")) return "PETSc takes .gz files for compressed ones; give another name";
  if (stat(file, &found)) return errno == ENOENT ? NULL : strerror(errno);
  *mode = found.st_mode;
  if (S_ISREG(found.st_mode)) return NULL;
  if (S_ISDIR(found.st_mode)) return "it is a folder, not a regular file; give another name";
  if (S_ISFIFO(found.st_mode)) return "it is a named pipe, not a regular file; give another name";
  if (S_ISSOCK(found.st_mode)) return "it is a socket, not a regular file; give another name";
  return "it is a device, not a regular file; give another name";
}

/* Sets target to the name that symbolic links lead to, whether or not that file exists */
static PetscErrorCode LatinFileFollow_Private(const char file[], char target[PETSC_MAX_PATH_LEN])
{
  char    to[PETSC_MAX_PATH_LEN];
  ssize_t n;

  PetscFunctionBegin;
  PetscCheck(strlen(file) < PETSC_MAX_PATH_LEN, PETSC_COMM_SELF, PETSC_ERR_FILE_OPEN, "%s", strerror(ENAMETOOLONG));
  strcpy(target, file);
  for (PetscInt links = 0; (n = readlink(target, to, sizeof(to) - 1)) >= 0; links++) {
    char  *slash = strrchr(target, '/'), *name = to[0] == '/' || !slash ? target : slash + 1; /* a relative target starts at the folder of the link */
    size_t room = (size_t)(target + PETSC_MAX_PATH_LEN - name);

    PetscCheck(links < LATIN_FILE_LINKS && (size_t)n < room, PETSC_COMM_SELF, PETSC_ERR_FILE_OPEN, "%s", strerror(ELOOP));
    memcpy(name, to, (size_t)n);
    name[n] = '\0';
  }
  PetscFunctionReturn(0);
}

/* Opens, locks and empties the new file, with the mode of the older one, or by the umask. Returns its descriptor; -1: error in errno */
static int LatinFileOpen_Private(const LatinFile *out)
{
  const int   fd = open(out->temporary, O_CREAT | O_RDWR | O_NOFOLLOW | O_NONBLOCK, out->mode ? 0600 | (out->mode & 0777) : 0666);
  struct stat mine, there;

  if (fd < 0) return fd;
  if (!fstat(fd, &mine) && !S_ISREG(mine.st_mode)) errno = EEXIST;
  else if (flock(fd, LOCK_EX | LOCK_NB) && errno == EWOULDBLOCK) errno = EBUSY;         /* file systems without locks: unlocked */
  else if (lstat(out->temporary, &there) || mine.st_ino != there.st_ino) errno = EBUSY; /* another run has just renamed it */
  else if (!ftruncate(fd, 0)) return fd;
  (void)close(fd);
  return -1;
}

/* Opens the new file: sets all members of out; out->stream must be NULL on entry */
PetscErrorCode LatinFileBegin_Private(const char file[], LatinFile *out)
{
  const char *why = LatinFileRefused(file, &out->mode), *name;
  int         fd  = -1, n;

  PetscFunctionBegin;
  PetscCheck(!why, PETSC_COMM_SELF, PETSC_ERR_FILE_OPEN, "%s", why);
  PetscCall(LatinFileFollow_Private(file, out->target));
  name = strrchr(out->target, '/') ? strrchr(out->target, '/') + 1 : out->target;
  n    = snprintf(out->temporary, sizeof(out->temporary), "%.*s.%.*s.latinpc", (int)(name - out->target), out->target, LATIN_FILE_NAME, name);
  if (n >= (int)sizeof(out->temporary)) errno = ENAMETOOLONG;
  else if (!*name) errno = EISDIR;
  else if (!out->mode || !access(out->target, W_OK)) fd = LatinFileOpen_Private(out);
  PetscCheck(fd >= 0 || errno != EBUSY, PETSC_COMM_SELF, PETSC_ERR_FILE_OPEN, "another run writes it at the same time; give each a file of its own");
  PetscCheck(fd >= 0, PETSC_COMM_SELF, PETSC_ERR_FILE_OPEN, "%s; check that its folder exists and may be written to", strerror(errno));
  out->stream = fdopen(fd, "r+b");
  PetscCheck(out->stream, PETSC_COMM_SELF, PETSC_ERR_FILE_OPEN, "%s", strerror(errno));
  PetscFunctionReturn(0);
}

/* Closes the new file: renames it to its final name if all of it was written; else, or after an error, removes it */
PetscErrorCode LatinFileEnd_Private(LatinFile *out, PetscBool written)
{
  PetscBool done = written;
  int       error;

  PetscFunctionBegin;
  if (!out->stream) PetscFunctionReturn(0);
  done  = (PetscBool)(done && !fflush(out->stream) && !fsync(fileno(out->stream)));
  done  = (PetscBool)(done && (!out->mode || !fchmod(fileno(out->stream), out->mode & 0777)) && !rename(out->temporary, out->target));
  error = errno;
  if (!done) (void)unlink(out->temporary);
  (void)fclose(out->stream);
  PetscCheck(done || !written, PETSC_COMM_SELF, PETSC_ERR_FILE_WRITE, "%s", strerror(error));
  PetscFunctionReturn(0);
}
