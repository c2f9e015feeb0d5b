/* An oscillator in PETSc's own terms, which knows nothing of latinpc: for -dll_append and -ts_type latin */
#include <petscts.h>

static PetscErrorCode Motion(TS ts, PetscReal t, Vec u, Vec v, Vec a, Vec f, void *ctx)
{
  PetscFunctionBegin;
  PetscCall(VecWAXPY(f, 1.0, u, a));
  PetscFunctionReturn(0);
}

int main(int argc, char **argv)
{
  TS  ts;
  Vec u, v;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  PetscCall(VecCreateSeq(PETSC_COMM_SELF, 1, &u));
  PetscCall(VecDuplicate(u, &v));
  PetscCall(VecSet(u, 1.0));
  PetscCall(TSCreate(PETSC_COMM_SELF, &ts));
  PetscCall(TSSetI2Function(ts, NULL, Motion, NULL));
  PetscCall(TS2SetSolution(ts, u, v));
  PetscCall(TSSetType(ts, TSALPHA2));
  PetscCall(TSSetTimeStep(ts, 0.1));
  PetscCall(TSSetMaxSteps(ts, 1));
  PetscCall(TSSetFromOptions(ts));
  PetscCall(TSSetUp(ts));
  PetscCall(TSDestroy(&ts));
  PetscCall(VecDestroy(&u));
  PetscCall(VecDestroy(&v));
  PetscCall(PetscFinalize());
  return 0;
}
