/*
   Solvers of the subdomains: which of them share a factor, factorisations and how they end, solvers by choice, the
   elimination of what is not on interfaces.
*/
#ifndef LATINLOCALSOLVERS_H
#define LATINLOCALSOLVERS_H

#include "subdomains/latinsubdomains.h"

/* ---- direct solvers (localsolvers/factor.c) ---- */
#define LATIN_MECHANISM LatinByPrecision(1e-14, 5e-6) /* stiffness of a displacement, relative to the diagonal, that only rounding makes nonzero */

#define LATIN_LARGE 1000 /* rows of a subdomain beyond which nested dissection of the nodes fills less than minimum degree, and pays for itself */

#define LATIN_ROUNDED_CONTRACTION 0.01 /* of a displacement, in energy: what a solve with a factor in single precision may leave to the next; the worst displacement some ten times that */

/* Precision of a factor; the one that is asked for, or a higher one that holds it */
typedef enum {
  LATIN_DOUBLE,  /* arithmetic and factor */
  LATIN_ROUNDED, /* arithmetic in double, the factor rounded to single precision */
  LATIN_SINGLE,  /* both in single */
  LATIN_BY_SIZE  /* that of the above which pays */
} LatinArithmetic;

/* How a factorisation ended on this rank */
typedef struct {
  PetscErrorCode ierr;
  PCFailedReason failed;
  PetscBool      mechanism;
  PetscReal      rounding;    /* of a displacement, in energy: what a solve leaves to the next one; 0: in double precision */
  PetscReal      softest;     /* stiffness of the softest displacement, where it was looked for in a factor that serves; else 0 */
  Vec            mode;        /* the displacement that costs nothing, where there is a mechanism */
  PetscBool      provisional; /* given: a stage will show whether the factor serves, and what it comes from may be made anew: no mode, no search for mechanisms */
  PetscBool      staged;      /* given, of a factor that keeps rows: stages will show which precision serves it and their Schur complement */
} LatinFactorStatus;
PETSC_INTERN PetscErrorCode LatinDirectSolverAvailable_Private(Mat, MatSolverType, MatSolverType *, PetscBool *);
PETSC_INTERN PetscErrorCode LatinDirectSolver_Private(PC, Mat, MatSolverType preferred);
PETSC_INTERN PetscErrorCode LatinFactor_Private(KSP, Mat, IS kept, Vec whole, const LatinArithmetic *larger, LatinFactorStatus *);
PETSC_INTERN PetscErrorCode LatinFactorRefine_Private(KSP, Mat, IS kept, LatinArithmetic, LatinFactorStatus *);
PETSC_INTERN PetscErrorCode LatinDenseCreate_Private(PetscInt, PetscInt, Mat *);
PETSC_INTERN PetscErrorCode LatinDenseSolve_Private(KSP, Mat B, Mat X, KSPConvergedReason *failed);
static inline PetscBool     LatinFactorFailed(const LatinFactorStatus *status)
{
  return (PetscBool)(status->ierr || status->failed || status->mechanism);
}

/* ---- the order of elimination (localsolvers/ordering.c) ---- */
#define LATIN_ORDERING "latin"       /* a MatOrderingType */
#define LATIN_PLACES   "LatinPlaces" /* what a matrix carries the places of its nodes by, a Vec whose block size is their dimension */
PETSC_INTERN PetscErrorCode LatinOrdering(Mat, MatOrderingType, IS *rows, IS *columns);
PETSC_INTERN PetscErrorCode LatinOrderingNodes_Private(PetscInt bs, PetscInt n, const PetscInt ia[], const PetscInt ja[], PetscInt first[], PetscInt **list);
PETSC_INTERN PetscErrorCode LatinOrderNodes_Private(Mat, PetscInt rows, const PetscInt ia[], const PetscInt ja[], const PetscBool kept[], PetscInt order[]);

/* ---- Cholesky with the interfaces last (localsolvers/cholesky.c) ---- */
#define LATIN_CHOLESKY    "latin"      /* a MatSolverType */
#define LATIN_ORDER       "LatinOrder" /* what a matrix carries its order of elimination by, an IS */
#define LATIN_FRONT_LANES 16           /* right-hand sides that lie beside each other: single precision fills a vector register of 512 bits */
/* Entries of a matrix, which the last fronts of its factorisation do not read: told that they have all been read, and may go, or (again) that they are to come back */
typedef struct {
  PetscErrorCode (*tell)(void *owner, PetscBool again); /* NULL: they stay */
  void *owner;
} LatinSpending;
PETSC_INTERN PetscErrorCode LatinCholeskyRegister(void);
PETSC_INTERN PetscErrorCode LatinCholeskyRound(PC, LatinArithmetic);
PETSC_INTERN PetscErrorCode LatinCholeskyPrecision(PC, LatinArithmetic *);
PETSC_INTERN PetscErrorCode LatinCholeskyEnergy(PC, Vec b, PetscReal *energy);
PETSC_INTERN PetscErrorCode LatinCholeskyCost(PC, PetscReal *operations, PetscReal *bytes);
PETSC_INTERN PetscErrorCode LatinCholeskyAgain(PC, Mat, LatinArithmetic);
PETSC_INTERN PetscErrorCode LatinCholeskyGives(Mat);
PETSC_INTERN PetscErrorCode LatinCholeskySpends(Mat, LatinSpending);
PETSC_INTERN PetscErrorCode LatinCholeskyGiveSchur(Mat, PetscReal **S);
PETSC_INTERN PetscErrorCode LatinCholeskyGiveLower(Mat, PetscReal **S);
PETSC_INTERN PetscErrorCode LatinCholeskyOrder(Mat, const PetscInt *order[]);
PETSC_INTERN PetscErrorCode LatinCholeskySolveSome(Mat, PetscInt rows, const PetscInt row[], PetscInt columns, PetscReal b[]);
PETSC_INTERN PetscErrorCode LatinCholeskySolveLanes(Mat, float x[], PetscReal energy[], PetscReal square[]);
PETSC_INTERN PetscErrorCode LatinCholeskyForward(Mat, PetscReal g[], PetscReal *energy);
PETSC_INTERN PetscErrorCode LatinCholeskyBackward(Mat, PetscReal g[], PetscReal *energy);

/* ---- one dense Schur complement (localsolvers/elimination.c) ---- */
PETSC_INTERN PetscErrorCode LatinEliminate_Private(const LatinSparse *, PetscInt gamma, const PetscInt kept[], PetscReal F[], PetscBool *bad);

/* ---- solvers that options choose (localsolvers/chosen.c) ---- */
#define LATIN_INEXACT_RTOL LatinByPrecision(1e-10, 1e-5) /* of an iterative solver that is taken to be exact */
PETSC_INTERN PetscErrorCode LatinSolverIsDefault_Private(PetscObject parent, const char name[], PetscBool *is);
PETSC_INTERN PetscErrorCode LatinSolverCreate_Private(MPI_Comm, PetscObject parent, const char name[], KSP *);
PETSC_INTERN PetscErrorCode LatinSolverDirect_Private(KSP, PetscBool *);
PETSC_INTERN PetscErrorCode LatinSolverNote_Private(KSP, PetscBool preconditions, PetscBool *failed);
PETSC_INTERN PetscErrorCode LatinSolverDefaults_Private(KSP, PetscBool once);
PETSC_INTERN PetscErrorCode LatinSolverAccurate_Private(KSP, PetscBool direct, KSP *);

/* ---- batches of subdomains and their solvers (localsolvers/batches.c) ---- */
#define LATIN_LANES         8  /* equal subdomains whose links are swept together */
#define LATIN_BATCH_COLUMNS 64 /* equal subdomains solved together: right-hand sides stay in cache */

/* Subdomains whose operators are equal to the bit share one */
typedef struct {
  PetscInt  members, *sub; /* the first one represents them */
  PetscInt  rows;          /* of the operator */
  PetscBool alike;         /* the links of all members have the same laws and the same order of states */
} LatinBatch;

typedef struct {
  PetscInt    n;
  LatinBatch *batch;
  PetscInt   *pattern; /* [subdomains] the subdomain that represents it */
} LatinBatches;
PETSC_INTERN PetscErrorCode LatinBatchesSetUp(const LatinSubdomains *, PetscInt pattern[], LatinBatches *);
PETSC_INTERN PetscErrorCode LatinBatchesReset(LatinBatches *);
PETSC_INTERN PetscInt       LatinBatchRun(const LatinBatch *, PetscInt m);

/* The matrix and the KSP of a batch of an earlier set-up, whose symbolic phase serves a matrix of the same pattern */
typedef struct {
  LatinSparse rows; /* that K is made of */
  Mat         K;
  KSP         ksp;
  IS          kept;
} LatinRetired;

/* One matrix and KSP a batch */
typedef struct LatinLocalSolvers {
  const LatinSubdomains          *sub;
  const LatinBatches             *batches;
  PetscInt                        n;
  PetscBool                       direct;             /* all of them are factorisations */
  LatinSparse                    *rows;               /* of the operators, filled by others */
  const PetscInt                 *kept_offset, *kept; /* [subdomains + 1] entries of the copy arrays that the factors keep to the last; NULL: none */
  const PetscBool                *keeps;              /* [batches] do they? NULL: all do, they are all of the interfaces, and who uses them measures what rounding leaves of both */
  const struct LatinLocalSolvers *like;               /* of the same rows, of which these hold some: their order of elimination serves as well; NULL: none */
  LatinPrecision                  precision;          /* that factors may have: who uses them corrects their solves */
  LatinSpending                   spending;           /* of the entries of the only operator */
  PetscReal                       rounding;           /* what of a solve the next one corrects, of the factors of this rank; 0: in double precision */
  Mat                            *K, *B, *X;          /* operator; right-hand sides and solutions of some members, dense */
  KSP                            *ksp;
  IS                             *rest; /* rows that the factor keeps to the last, NULL: none */
  PetscInt                        retired;
  LatinRetired                   *before; /* [retired] of the last set-up, until this one has taken what it can use */
  LatinFactorStatus               status; /* of the set-up on this rank */
  PetscInt                        last;   /* the last batch that was set up: where a failure is */
  PetscBool                       failed; /* a solve failed on this rank since this was cleared */
} LatinLocalSolvers;
PETSC_INTERN PetscErrorCode LatinLocalSolversCreate(const LatinSubdomains *, const LatinBatches *, LatinLocalSolvers *);
PETSC_INTERN PetscErrorCode LatinLocalSolversSetUp(LatinLocalSolvers *, const char name[], PetscBool once);
PETSC_INTERN PetscErrorCode LatinLocalSolversRefine(LatinLocalSolvers *);
PETSC_INTERN PetscErrorCode LatinLocalSolversDestroy(LatinLocalSolvers *);
PETSC_INTERN PetscErrorCode LatinLocalSolversRetire(LatinLocalSolvers *);
PETSC_INTERN PetscErrorCode LatinLocalSolversRenew_Private(LatinLocalSolvers *, PetscInt batch, const PetscReal spring[], const PetscBool held[], PetscBool *done);
PETSC_INTERN PetscErrorCode LatinLocalSolversRecall_Private(LatinLocalSolvers *, PetscInt batch, PetscBool *found);
PETSC_INTERN PetscErrorCode LatinSameRows_Private(Mat, PetscInt rows, const PetscInt i[], const PetscInt j[], PetscBool *same);
PETSC_INTERN PetscErrorCode LatinLocalSolve_Private(LatinLocalSolvers *, PetscInt batch, const PetscReal g[], PetscReal U[]);
PETSC_INTERN PetscErrorCode LatinLocalSolveAll(LatinLocalSolvers *, const PetscReal g[], PetscReal U[]);

#endif
