#include "base/interrupt.h"
#include <latinpc.h>

/* Interruption of long solves: a function of the program that they call, such as one that has seen Ctrl-C. */

static LatinInterruptFn *interrupt = NULL;

/*@C
  LatinSetInterrupt - Sets the function that may end a solve: all solvers call it before each linear stage, factorisation and residual.

  Logically Collective

  Input Parameter:
. check - returns 0 to continue, or an error code, which ends the solve and which the solve returns; NULL: none

  Level: advanced

  Notes:
  After an interruption the solver has no result (`SNESGetConvergedReason()` gives 0), and can solve again.

  On several ranks the function must return the same on all of them. An error on some ranks alone ends the program.

  It applies to all objects of the process. `import latinpc` sets one on one rank, so that Ctrl-C raises `KeyboardInterrupt`.

.seealso: `LatinInitializePackage()`
@*/
PetscErrorCode LatinSetInterrupt(LatinInterruptFn *check)
{
  PetscFunctionBegin;
  interrupt = check;
  PetscFunctionReturn(0);
}

/* Raises the error of the function of LatinSetInterrupt(), if it returns one. Logically collective */
PetscErrorCode LatinInterrupt_Private(void)
{
  PetscFunctionBegin;
  if (interrupt) PetscCall((*interrupt)());
  PetscFunctionReturn(0);
}
