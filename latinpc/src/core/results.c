#include "core/latinimpl.h"

/* Getters of the decomposition: sizes, subdomains, classes of nodes, homogenised stiffnesses, inner solvers. */

/* Checks that latin is set up. Collective on latin */
PetscErrorCode LatinCheckSetUp_Private(Latin latin)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(latin, LATIN_CLASSID, 1);
  PetscCheck(latin->set_up, PetscObjectComm((PetscObject)latin), PETSC_ERR_ORDER, "The decomposition does not exist yet: call SNESSetUp() or PCSetUp() first");
  PetscFunctionReturn(0);
}

/*@C
  LatinGetStatistics - Gets the sizes of the decomposition, over all ranks.

  Collective on latin

  Synopsis:
  PetscErrorCode LatinGetStatistics(Latin latin, LatinStatistics *statistics)

  Input Parameter:
. latin - after its set-up

  Output Parameter:
. statistics - struct, overwritten

  Note:
  A macro, which passes the size of the caller's struct: programs compiled before members were added stay valid.

  Level: intermediate

.seealso: `LatinGetCost()`, `LatinGetSubdomains()`
@*/
PetscErrorCode LatinGetStatisticsOfSize(Latin latin, size_t size, LatinStatistics *statistics)
{
  const LatinSubdomains *sub   = &latin->sub;
  const LatinInterfaces *inter = &latin->inter;
  MPI_Comm               comm  = PetscObjectComm((PetscObject)latin);
  LatinStatistics        all;
  PetscReal              range[2] = {-PETSC_MAX_REAL, 0.0}, sum[2] = {0.0, 0.0};

  PetscFunctionBegin;
  PetscCall(LatinCheckSetUp_Private(latin));
  sum[1] = inter->sides;
  for (PetscInt k = 0; k < inter->sides; k++) {
    range[0] = PetscMax(range[0], -latin->dir.d[k]);
    range[1] = PetscMax(range[1], latin->dir.d[k]);
    sum[0] += latin->dir.d[k];
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, range, 2, MPIU_REAL, MPIU_MAX, comm));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, comm));
  all = (LatinStatistics){
    .subdomains        = sub->count,
    .strong_interfaces = inter->strong_global,
    .weak_interfaces   = inter->weak_global,
    .strong_macro_dofs = latin->macro.modes_global,
    .weak_dofs         = latin->coarse.primal_global,
    .coarse_size       = latin->coarse.top_size,
    .coarse_levels     = latin->coarse.levels,
    .local_macro_dofs  = latin->macro.spectral_global,
    .micro_sides       = inter->side_nodes_global,
    .state_size        = inter->sides + sub->nonsmooth,
    .direction_min     = sum[1] > 0.0 ? -range[0] : 0.0,
    .direction_mean    = sum[1] > 0.0 ? sum[0] / sum[1] : 0.0,
    .direction_max     = range[1],
  };
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &all.state_size, 1, MPIU_INT, MPI_SUM, comm));
  PetscCall(LatinSpectralStatistics_Private(&latin->spectral, &all.low_energy_subdomains, &all.local_modes_max));
  PetscCall(PetscMemzero(statistics, size));
  PetscCall(PetscMemcpy(statistics, &all, PetscMin(size, sizeof(all))));
  PetscFunctionReturn(0);
}

/*@C
  LatinGetSubdomains - Gets the number of subdomains of this rank, and the global number of the first one.

  Not collective

  Input Parameter:
. latin - after its set-up

  Output Parameters:
+ n_local - subdomains of this rank, or NULL
- first   - global number of the first of them, or NULL

  Level: intermediate

.seealso: `LatinSetSubdomains()`, `LatinGetSubdomainIS()`, `LatinGetSubdomainOfLinks()`
@*/
PetscErrorCode LatinGetSubdomains(Latin latin, PetscInt *n_local, PetscInt *first)
{
  PetscFunctionBegin;
  PetscCall(LatinCheckSetUp_Private(latin));
  if (n_local) *n_local = latin->sub.n;
  if (first) *first = latin->sub.first;
  PetscFunctionReturn(0);
}

/* Checks that this rank has a subdomain i. Not collective */
static PetscErrorCode LatinCheckSubdomain_Private(Latin latin, PetscInt i)
{
  PetscFunctionBegin;
  PetscCall(LatinCheckSetUp_Private(latin));
  PetscCheck(i >= 0 && i < latin->sub.n, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE, "Subdomain %" PetscInt_FMT " of this rank does not exist: it has %" PetscInt_FMT, i, latin->sub.n);
  PetscFunctionReturn(0);
}

/*@C
  LatinGetSubdomainIS - Gets the free degrees of freedom of a subdomain of this rank, as entries of DM global vectors, increasing.

  Not collective; the caller destroys the index set

  Input Parameters:
+ latin - after its set-up
- i     - subdomain of this rank, from 0

  Output Parameter:
. is - on PETSC_COMM_SELF

  Level: intermediate

.seealso: `LatinGetSubdomains()`, `LatinGetSubdomainOfLinks()`
@*/
PetscErrorCode LatinGetSubdomainIS(Latin latin, PetscInt i, IS *is)
{
  const LatinSubdomains *sub = &latin->sub;
  PetscInt              *list, n = 0, first, last;

  PetscFunctionBegin;
  PetscCall(LatinCheckSubdomain_Private(latin, i));
  PetscAssertPointer(is, 3);
  first = sub->bs * sub->node_offset[i];
  last  = sub->bs * sub->node_offset[i + 1];
  PetscCall(PetscMalloc1(last - first, &list));
  for (PetscInt k = first; k < last; k++)
    if (!sub->fixed[k]) list[n++] = sub->global_dof[k];
  PetscCall(PetscSortInt(n, list));
  PetscCall(ISCreateGeneral(PETSC_COMM_SELF, n, list, PETSC_OWN_POINTER, is));
  PetscFunctionReturn(0);
}

/*@C
  LatinGetSubdomainOfLinks - Gets the subdomain of each link that this rank created, in the caller's order.

  Not collective

  Input Parameter:
. latin - after its set-up

  Output Parameter:
. subdomain - [links_local] global numbers

  Level: intermediate

.seealso: `LatinSetPartition()`, `LatinGetSubdomains()`, `LatinGetNodeClasses()`
@*/
PetscErrorCode LatinGetSubdomainOfLinks(Latin latin, PetscInt subdomain[])
{
  PetscFunctionBegin;
  PetscCall(LatinCheckSetUp_Private(latin));
  PetscCheck(latin->sub.structure, PetscObjectComm((PetscObject)latin), PETSC_ERR_ARG_WRONG, "The decomposition is that of a matrix: it has no links");
  if (latin->sub.structure->original)
    for (PetscInt l = 0; l < latin->sub.structure->original->links_local; l++) subdomain[l] = latin->sub.of_link[latin->sub.dim * l];
  else PetscCall(PetscArraycpy(subdomain, latin->sub.of_link, latin->sub.structure->links_local));
  PetscFunctionReturn(0);
}

/*@C
  LatinGetNodeClasses - Gets the class of each node that this rank created, or of each row of a matrix here: 0 inside a subdomain, 1 on strong
  interfaces only, 2 on a weak interface, 3 primal (a corner, or a macro weak interface).

  Collective on latin

  Input Parameter:
. latin - after its set-up

  Output Parameter:
. node_class - [nodes_local], or [local rows] of a matrix

  Level: intermediate

.seealso: `LatinGetSubdomainOfLinks()`, `LatinSetVariant()`
@*/
PetscErrorCode LatinGetNodeClasses(Latin latin, PetscInt node_class[])
{
  PetscFunctionBegin;
  PetscCall(LatinCheckSetUp_Private(latin));
  PetscCall(PetscArrayzero(node_class, latin->sub.nodes_local));
  PetscCall(LatinSFReduce_Private(latin->sub.node_sf, 1, MPIU_INT, latin->inter.node_class, node_class, MPI_MAX));
  PetscFunctionReturn(0);
}

/*@C
  LatinGetMacroStiffness - Gets the homogenised stiffness (29), (51) of subdomain i of this rank, a dense matrix: macro modes of the
  strong interfaces first, then primal displacements.

  Not collective; the caller destroys the matrix

  Input Parameters:
+ latin - after its set-up
- i     - subdomain of this rank, from 0

  Output Parameter:
. H - force/length, a dense matrix on PETSC_COMM_SELF

  Level: intermediate

  Note:
  Symmetric and positive semidefinite. The kernel contains the rigid motions and the mechanisms of a floating subdomain.

.seealso: `LatinSetModes()`, `LatinGetCoarseKSP()`
@*/
PetscErrorCode LatinGetMacroStiffness(Latin latin, PetscInt i, Mat *H)
{
  PetscInt     m;
  PetscScalar *a;

  PetscFunctionBegin;
  PetscCall(LatinCheckSubdomain_Private(latin, i));
  m = latin->coarse.offset[i + 1] - latin->coarse.offset[i];
  PetscCall(LatinDenseCreate_Private(m, m, H));
  PetscCall(MatDenseGetArrayWrite(*H, &a));
  if (latin->linear.stiffness.H) PetscCall(PetscArraycpy(a, latin->linear.stiffness.H + latin->linear.stiffness.h_offset[i], (size_t)m * (size_t)m));
  else if (m) PetscCall(LatinSubstructuresStiffnessAgain(&latin->linear, i, a));
  PetscCall(MatDenseRestoreArrayWrite(*H, &a));
  PetscCall(MatSetOption(*H, MAT_SYMMETRIC, PETSC_TRUE));
  PetscFunctionReturn(0);
}

/*@C
  LatinGetLocalKSP - Gets the solver of subdomain i of this rank; equal subdomains share one. NULL with a dense inverse, as in coarse problems of substructures.

  Not collective; the reference is borrowed

  Input Parameters:
+ latin - after its set-up
- i     - subdomain of this rank, from 0

  Output Parameter:
. ksp - the solver, or NULL

  Level: advanced

  Note:
  If the method needs only its factor, the matrix has no values until this call computes them; call it after each set-up.

.seealso: `LatinGetCoarseKSP()`
@*/
PetscErrorCode LatinGetLocalKSP(Latin latin, PetscInt i, KSP *ksp)
{
  const LatinBatches *batches = &latin->batches;

  PetscFunctionBegin;
  PetscCall(LatinCheckSubdomain_Private(latin, i));
  PetscAssertPointer(ksp, 3);
  PetscCall(LatinSubstructuresFill(&latin->linear));
  for (PetscInt b = 0; b < batches->n; b++)
    for (PetscInt k = 0; k < batches->batch[b].members; k++)
      if (batches->batch[b].sub[k] == i) *ksp = latin->solvers.ksp[b];
  PetscFunctionReturn(0);
}

/*@C
  LatinGetCoarseKSP - Gets the solver of the coarse problem; NULL if there is no interface.

  Not collective; the reference is borrowed

  Input Parameter:
. latin - after its set-up

  Output Parameter:
. ksp - the solver, or NULL

  Level: advanced

  Note:
  With the parallel multifrontal solver of SNES latin (latintree) the matrix has no values: it has a size, but no product.

.seealso: `LatinGetLocalKSP()`, `SNESLatinGetOuter()`, `KSPLatinGetOuter()`
@*/
PetscErrorCode LatinGetCoarseKSP(Latin latin, KSP *ksp)
{
  PetscFunctionBegin;
  PetscCall(LatinCheckSetUp_Private(latin));
  PetscAssertPointer(ksp, 2);
  *ksp = latin->coarse.ksp;
  PetscFunctionReturn(0);
}
