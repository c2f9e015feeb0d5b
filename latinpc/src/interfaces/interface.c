#include "interfaces/latininterfaces.h"

/*
   Interfaces (section 3.1) and what the variants make of them:

   1. The subdomains at each node (interfaces/sharednodes.c).
   2. Interfaces and their classes, strong or weak (section 4).
   3. Primal components of nodes: subdomains that share one displacement. The variants differ in LatinNodePrimal_Private() and nowhere else.
   4. Side dofs: pairs of subdomains that keep micro quantities at a node.
   5. Assignment of nodes to interfaces, for independent macro constraints.
   6. Mates of side dofs; primal dofs (interfaces/primal.c).
*/

#define LATIN_FRAME_POINT 16.0 /* extent below which nodes are one point to rounding, in machine epsilons of the largest coordinate */
/* square of an extent, relative to that of the largest, below which it is zero: extents below 1e-6 of the largest make a plane or a line */
#define LATIN_FRAME_FLAT LatinByPrecision(1e-12, 1e-5)

enum { PAIR_STRONG = 1, PAIR_WEAK = 2 };

/* Computes origin, centre and size of a frame. Returns the number of nodes with a free component, of which the centre is the mean */
static PetscInt LatinFrameCentre(const LatinSubdomains *sub, PetscInt n, const PetscInt copies[], LatinFrame *frame)
{
  const PetscInt dim     = sub->dim;
  PetscReal      largest = 0.0;
  PetscInt       used    = 0;

  for (PetscInt i = 0; i < n; i++) {
    const PetscReal *xi = sub->x + dim * copies[i];

    if (!LatinNodeFree(sub, copies[i])) continue;
    for (PetscInt c = 0; c < dim; c++) {
      if (!used) frame->origin[c] = xi[c];
      frame->centre[c] += xi[c] - frame->origin[c];
      largest = PetscMax(largest, PetscAbsReal(xi[c]));
    }
    used++;
  }
  for (PetscInt c = 0; c < dim; c++) frame->centre[c] /= PetscMax(used, 1);
  for (PetscInt i = 0; i < n; i++)
    for (PetscInt c = 0; c < dim; c++) frame->size = PetscMax(frame->size, PetscAbsReal((sub->x[dim * copies[i] + c] - frame->origin[c]) - frame->centre[c]));
  if (frame->size <= LATIN_FRAME_POINT * PETSC_MACHINE_EPSILON * largest) frame->size = 0.0; /* one point, to rounding */
  return used;
}

/* Computes the second moments a of the nodes about the centre, [dim][dim], relative to the size */
static void LatinFrameMoments(const LatinSubdomains *sub, PetscInt n, const PetscInt copies[], const LatinFrame *frame, PetscScalar a[])
{
  const PetscInt dim = sub->dim;

  for (PetscInt c = 0; c < dim * dim; c++) a[c] = 0.0;
  for (PetscInt i = 0; i < n; i++) {
    PetscReal r[3] = {0.0, 0.0, 0.0};

    for (PetscInt c = 0; c < dim; c++) r[c] = ((sub->x[dim * copies[i] + c] - frame->origin[c]) - frame->centre[c]) / frame->size;
    for (PetscInt c = 0; c < dim; c++)
      for (PetscInt b = 0; b < dim; b++) a[c * dim + b] += r[c] * r[b];
  }
}

/*
   Computes the frame of an interface: centre, size and principal axes of its nodes with a free component. The interface is strong when its nodes span
   dim - 1 directions and so can carry the affine fields of section 3.2; without coordinates, when it has more nodes than there are fields. Differences
   of coordinates are scaled by the size: neither units nor the origin matter.
*/
PetscErrorCode LatinInterfaceFrame_Private(const LatinSubdomains *sub, PetscInt n, const PetscInt copies[], LatinFrame *frame)
{
  const PetscInt dim = sub->dim;
  PetscScalar    a[9], w[3], work[32];
  PetscBLASInt   bn, lwork = 32, info;
  PetscInt       used;

  PetscFunctionBegin;
  PetscCall(PetscMemzero(frame, sizeof(*frame)));
  used         = LatinFrameCentre(sub, n, copies, frame);
  frame->plane = PETSC_TRUE;
  if (dim < 2 || frame->size == 0.0) {
    frame->strong = (PetscBool)(dim == 1 ? used > 0 : dim == 0 && used > sub->fields);
    PetscFunctionReturn(0);
  }
  LatinFrameMoments(sub, n, copies, frame, a);
  PetscCall(PetscBLASIntCast(dim, &bn));
  PetscCallBLAS("LAPACKsyev", LAPACKsyev_("V", "U", &bn, a, &bn, w, work, &lwork, &info));
  PetscCheck(!info, PETSC_COMM_SELF, PETSC_ERR_LIB, "LAPACK could not find the principal plane of an interface (info %d)", (int)info);
  for (PetscInt k = 0; k < dim; k++)
    for (PetscInt c = 0; c < dim; c++) frame->axes[k][c] = a[(dim - 1 - k) * dim + c];
  /* w: squares of the extents, increasing */
  frame->plane     = (PetscBool) !(w[0] > LATIN_FRAME_FLAT * w[dim - 1]);
  frame->strong    = (PetscBool)(dim == 2 || w[1] > LATIN_FRAME_FLAT * w[2]);
  frame->thickness = w[0] > 0.0 ? PetscSqrtReal(w[0] / w[dim - 1]) : 0.0;
  PetscFunctionReturn(0);
}

/* Lists the interfaces of each subdomain, their nodes and their classes. Collective on sub->object */
static PetscErrorCode LatinInterfaceList_Private(LatinInterfaces *inter)
{
  const LatinSubdomains *sub = inter->sub;
  LatinKey              *pair; /* neighbour and copy; copies are sorted by node number, so both sides list their nodes in the same order */
  PetscInt               total = 0, count = 0, counts[2] = {0, 0};

  PetscFunctionBegin;
  for (PetscInt i = 0; i < sub->copies; i++) {
    const PetscInt m = inter->share_offset[i + 1] - inter->share_offset[i];

    total += m ? m - 1 : 0;
  }
  PetscCall(PetscMalloc1(total, &pair));
  PetscCall(PetscMalloc1(total, &inter->node_list));
  PetscCall(PetscMalloc1(sub->n + 1, &inter->offset));
  total = 0;
  for (PetscInt s = 0; s < sub->n; s++) {
    const PetscInt begin = total;

    for (PetscInt i = sub->node_offset[s]; i < sub->node_offset[s + 1]; i++)
      for (PetscInt j = inter->share_offset[i]; j < inter->share_offset[i + 1]; j++) {
        if (inter->share_list[j] == sub->first + s) continue;
        pair[total++] = (LatinKey){.hash = (uint64_t)inter->share_list[j], .number = i};
      }
    if (total > begin) qsort(pair + begin, (size_t)(total - begin), sizeof(*pair), LatinKeyCompare);
    inter->offset[s] = count;
    for (PetscInt p = begin; p < total; p++)
      if (p == begin || pair[p].hash != pair[p - 1].hash) count++;
  }
  inter->offset[sub->n] = count;
  inter->count          = count;
  PetscCall(PetscCalloc1(count, &inter->interface));
  for (PetscInt s = 0, p = 0; s < sub->n; s++)
    for (PetscInt i = inter->offset[s]; i < inter->offset[s + 1]; i++) {
      LatinInterface *face = &inter->interface[i];
      LatinFrame      frame;

      face->sub        = s;
      face->neighbour  = (PetscInt)pair[p].hash;
      face->node_first = p;
      while (p < total && (PetscInt)pair[p].hash == face->neighbour && pair[p].number < sub->node_offset[s + 1]) {
        inter->node_list[p] = pair[p].number;
        p++;
      }
      face->node_last = p;
      PetscCall(LatinInterfaceFrame_Private(sub, face->node_last - face->node_first, inter->node_list + face->node_first, &frame));
      face->strong = frame.strong;
      if (sub->first + s < face->neighbour) counts[face->strong ? 0 : 1]++;
    }
  PetscCall(PetscFree(pair));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, counts, 2, MPIU_INT, MPI_SUM, PetscObjectComm(inter->sub->object)));
  inter->strong_global = counts[0];
  inter->weak_global   = counts[1];
  PetscFunctionReturn(0);
}

/* Finds the connected components of m subdomains joined by pairs of class `pairs`; component[j]: lowest member of that of j */
static void LatinNodeComponents(PetscInt m, const PetscInt table[], PetscInt pairs, PetscInt component[])
{
  PetscBool changed = PETSC_TRUE;

  for (PetscInt j = 0; j < m; j++) component[j] = j;
  while (changed) {
    changed = PETSC_FALSE;
    for (PetscInt i = 0; i < m; i++)
      for (PetscInt j = 0; j < m; j++)
        if (i != j && table[i * m + j] == pairs && component[j] < component[i]) {
          component[i] = component[j];
          changed      = PETSC_TRUE;
        }
  }
}

/*
   Finds the primal components of a node: sets of subdomains that share one displacement there, a coarse unknown.

     none       no primal component (4.1)
     macro      the whole displacement of a weak interface is macro (4.2); weak interfaces that meet at the node are merged
     corner     one component of all subdomains of the node, if one of its interfaces is weak (4.4) or three or more subdomains meet there:
                on irregular partitions such nodes may have strong interfaces alone
     published  as corner
     primal     one component at every shared node

   primal[j]: lowest member of the component of j, -1: none.
*/
static void LatinNodePrimal_Private(LatinVariant variant, PetscInt m, const PetscInt table[], PetscInt primal[])
{
  PetscBool weak = PETSC_FALSE;

  for (PetscInt j = 0; j < m * m; j++) weak = (PetscBool)(weak || table[j] == PAIR_WEAK);
  for (PetscInt j = 0; j < m; j++) primal[j] = -1;
  if (variant == LATIN_VARIANT_PRIMAL || ((variant == LATIN_VARIANT_CORNER || variant == LATIN_VARIANT_PUBLISHED) && (weak || m > 2))) {
    for (PetscInt j = 0; j < m; j++) primal[j] = 0;
  } else if (weak && variant == LATIN_VARIANT_MACRO) {
    LatinNodeComponents(m, table, PAIR_WEAK, primal);
    for (PetscInt j = 0; j < m; j++) {
      PetscInt size = 0;

      for (PetscInt i = 0; i < m; i++) size += primal[i] == primal[j] ? 1 : 0;
      if (size == 1) primal[j] = -1;
    }
  }
}

/*
   Whether the subdomains at positions i and j keep micro quantities at the node. A primal component keeps none inside, as the displacement is
   continuous already; but `published` keeps the article's springs on strong interfaces. A weak pair is redundant and dropped if strong pairs of the
   node connect its two subdomains (4.1).
*/
static PetscBool LatinNodeMicro_Private(PetscBool published, PetscInt m, const PetscInt table[], const PetscInt primal[], const PetscInt strong[], PetscInt i, PetscInt j)
{
  const PetscBool glued = (PetscBool)(primal[i] >= 0 && primal[i] == primal[j]);

  if (table[i * m + j] == PAIR_STRONG) return (PetscBool)(published || !glued);
  return (PetscBool)(!glued && strong[i] != strong[j]);
}

/* Creates the tables *pairs of the class, strong or weak, of each pair of subdomains at each node. Collective on sub->object */
static PetscErrorCode LatinInterfacePairs_Private(LatinInterfaces *inter, PetscInt **pairs)
{
  PetscInt *table;

  PetscFunctionBegin;
  PetscCall(PetscCalloc1(inter->table_offset[inter->sub->copies], &table));
  for (PetscInt f = 0; f < inter->count; f++) {
    const LatinInterface *face = &inter->interface[f];

    for (PetscInt p = face->node_first; p < face->node_last; p++) {
      const PetscInt i = inter->node_list[p], m = inter->share_offset[i + 1] - inter->share_offset[i];
      PetscInt       j;

      PetscCall(PetscFindInt(face->neighbour, m, inter->share_list + inter->share_offset[i], &j));
      table[inter->table_offset[i] + inter->position[i] * m + j] = face->strong ? PAIR_STRONG : PAIR_WEAK;
    }
  }
  PetscCall(LatinInterfaceExchange_Private(inter, table));
  *pairs = table;
  PetscFunctionReturn(0);
}

/*
   Sets the class and the primal component of each copy. primal[], strong[], by share_offset: of each subdomain at the node of a copy, its primal
   component and its component by strong interfaces alone
*/
static PetscErrorCode LatinInterfaceClasses_Private(LatinInterfaces *inter, const PetscInt table[], PetscInt primal[], PetscInt strong[])
{
  const LatinSubdomains *sub = inter->sub;

  PetscFunctionBegin;
  PetscCall(PetscMalloc3(sub->copies, &inter->node_class, sub->copies, &inter->component, sub->copies, &inter->glued));
  for (PetscInt i = 0; i < sub->copies; i++) {
    const PetscInt  m = inter->share_offset[i + 1] - inter->share_offset[i], at = inter->share_offset[i];
    const PetscInt *t = table + inter->table_offset[i];

    inter->component[i]  = -1;
    inter->glued[i]      = PETSC_FALSE;
    inter->node_class[i] = m ? 1 : 0;
    for (PetscInt j = 0; j < m * m; j++)
      if (t[j] == PAIR_WEAK) inter->node_class[i] = 2;
    if (m) {
      LatinNodePrimal_Private(inter->variant, m, t, primal + at);
      LatinNodeComponents(m, t, PAIR_STRONG, strong + at);
      inter->component[i] = primal[at + inter->position[i]];
      if (inter->component[i] >= 0) inter->node_class[i] = 3;
      for (PetscInt j = 0; j < m; j++)
        if (primal[at + j] >= 0) inter->glued[i] = PETSC_TRUE;
    }
  }
  PetscFunctionReturn(0);
}

/* Lists the side dofs: free dofs of interfaces that carry micro quantities. Collective on sub->object */
static PetscErrorCode LatinInterfaceSides_Private(LatinInterfaces *inter)
{
  const LatinSubdomains *sub = inter->sub;
  const PetscInt         bs  = inter->sub->bs;
  PetscInt              *table, *primal, *strong, capacity = 0, side_nodes = 0;

  PetscFunctionBegin;
  PetscCall(LatinInterfacePairs_Private(inter, &table));
  for (PetscInt f = 0; f < inter->count; f++) capacity += bs * (inter->interface[f].node_last - inter->interface[f].node_first);
  PetscCall(PetscMalloc2(inter->share_offset[sub->copies], &primal, inter->share_offset[sub->copies], &strong));
  PetscCall(LatinInterfaceClasses_Private(inter, table, primal, strong));
  PetscCall(PetscMalloc1(capacity, &inter->side_dof));
  inter->sides = 0;
  for (PetscInt f = 0; f < inter->count; f++) {
    LatinInterface *face = &inter->interface[f];

    face->side_first = inter->sides;
    for (PetscInt p = face->node_first; p < face->node_last; p++) {
      const PetscInt  i = inter->node_list[p], at = inter->share_offset[i], m = inter->share_offset[i + 1] - at;
      const PetscInt *t = table + inter->table_offset[i];
      PetscInt        j;

      PetscCall(PetscFindInt(face->neighbour, m, inter->share_list + at, &j));
      if (!LatinNodeMicro_Private((PetscBool)(inter->variant == LATIN_VARIANT_PUBLISHED), m, t, primal + at, strong + at, inter->position[i], j)) continue;
      side_nodes++;
      for (PetscInt c = 0; c < bs; c++)
        if (!sub->fixed[bs * i + c]) inter->side_dof[inter->sides++] = bs * i + c;
    }
    face->side_last = inter->sides;
  }
  PetscCall(PetscFree2(primal, strong));
  PetscCall(PetscFree(table));
  PetscCall(MPIU_Allreduce(&side_nodes, &inter->side_nodes_global, 1, MPIU_INT, MPI_SUM, PetscObjectComm(inter->sub->object)));
  PetscFunctionReturn(0);
}

/*
   Assigns each node to one interface at most; macro modes of an interface are kept only if they do not vanish on its assigned nodes. A node is assigned
   to the one of its strong interfaces with the fewest nodes; a node with a primal component to none. So the macro constraints of a subdomain are
   independent: the nodes assigned to an interface are on no smaller strong interface (take the interfaces by decreasing size). Collective on
   sub->object
*/
static PetscErrorCode LatinInterfaceAssign_Private(LatinInterfaces *inter)
{
  const LatinSubdomains *sub = inter->sub;
  const PetscInt         bs  = inter->sub->bs;
  PetscInt              *table;

  PetscFunctionBegin;
  PetscCall(PetscCalloc1(inter->table_offset[sub->copies], &table));
  PetscCall(PetscMalloc1(inter->sides, &inter->assigned));
  for (PetscInt pass = 0; pass < 2; pass++) {
    for (PetscInt f = 0; f < inter->count; f++) {
      const LatinInterface *face  = &inter->interface[f];
      PetscInt              nodes = 0;

      for (PetscInt k = face->side_first; k < face->side_last; k++)
        if (k == face->side_first || inter->side_dof[k] / bs != inter->side_dof[k - 1] / bs) nodes++;
      for (PetscInt k = face->side_first; k < face->side_last; k++) {
        const PetscInt i = inter->side_dof[k] / bs, m = inter->share_offset[i + 1] - inter->share_offset[i];
        PetscInt      *t = table + inter->table_offset[i], other, low = -1, high = -1;

        PetscCall(PetscFindInt(face->neighbour, m, inter->share_list + inter->share_offset[i], &other));
        if (!pass) {
          t[inter->position[i] * m + other] = face->strong ? nodes : 0;
          continue;
        }
        for (PetscInt a = 0; a < m; a++)
          for (PetscInt b = a + 1; b < m; b++)
            if (t[a * m + b] && (low < 0 || t[a * m + b] < t[low * m + high])) {
              low  = a;
              high = b;
            }
        inter->assigned[k] = (PetscBool)(!inter->glued[i] && low == PetscMin(inter->position[i], other) && high == PetscMax(inter->position[i], other));
      }
    }
    if (!pass) PetscCall(LatinInterfaceExchange_Private(inter, table));
  }
  PetscCall(PetscFree(table));
  PetscFunctionReturn(0);
}

/*
   Creates mate_sf. The mate of a side dof is the same component of the same node on the other side of the interface, perhaps on another rank.
   Collective on sub->object
*/
static PetscErrorCode LatinInterfaceMates_Private(LatinInterfaces *inter)
{
  const LatinSubdomains *sub  = inter->sub;
  const PetscInt         bs   = inter->sub->bs;
  MPI_Comm               comm = PetscObjectComm(inter->sub->object);
  PetscInt              *table;
  PetscSFNode           *remote;
  PetscMPIInt            size;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(comm, &size));
  PetscCall(PetscCalloc1(inter->table_offset[sub->copies], &table));
  PetscCall(PetscMalloc1(inter->sides, &remote));
  for (PetscInt pass = 0; pass < 2; pass++) {
    for (PetscInt f = 0; f < inter->count; f++) {
      const LatinInterface *face  = &inter->interface[f];
      const PetscMPIInt     owner = LatinSubdomainRank(sub, size, face->neighbour);

      for (PetscInt k = face->side_first; k < face->side_last;) {
        const PetscInt i = inter->side_dof[k] / bs, m = inter->share_offset[i + 1] - inter->share_offset[i];
        PetscInt      *t = table + inter->table_offset[i], j, first = k;

        PetscCall(PetscFindInt(face->neighbour, m, inter->share_list + inter->share_offset[i], &j));
        if (!pass) t[inter->position[i] * m + j] = k + 1;
        for (; k < face->side_last && inter->side_dof[k] / bs == i; k++) {
          if (!pass) continue;
          remote[k].rank  = owner;
          remote[k].index = t[j * m + inter->position[i]] - 1 + k - first;
        }
      }
    }
    if (!pass) PetscCall(LatinInterfaceExchange_Private(inter, table));
  }
  PetscCall(PetscFree(table));
  PetscCall(PetscSFCreate(comm, &inter->mate_sf));
  PetscCall(PetscSFSetGraph(inter->mate_sf, inter->sides, inter->sides, NULL, PETSC_OWN_POINTER, remote, PETSC_OWN_POINTER));
  PetscCall(PetscSFSetUp(inter->mate_sf));
  PetscFunctionReturn(0);
}

/* Sets inter->condensed. Collective on sub->object */
static PetscErrorCode LatinInterfaceCondensed_Private(LatinInterfaces *inter)
{
  PetscFunctionBegin;
  inter->condensed = (PetscBool)(inter->sub->ki != NULL);
  for (PetscInt i = 0; i < inter->sub->copies && inter->condensed; i++) inter->condensed = (PetscBool)(inter->share_offset[i] < inter->share_offset[i + 1]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &inter->condensed, 1, LATIN_MPI_BOOL, MPI_LAND, PetscObjectComm(inter->sub->object)));
  PetscFunctionReturn(0);
}

/* Finds interfaces, side dofs and primal dofs from inter->sub and inter->variant. Collective on sub->object */
PetscErrorCode LatinInterfaceSetUp(LatinInterfaces *inter)
{
  PetscFunctionBegin;
  PetscCall(PetscLogEventBegin(LATIN_Interface, inter->sub->object, 0, 0, 0));
  PetscCall(LatinInterfaceShares_Private(inter));
  PetscCall(LatinInterfaceList_Private(inter));
  PetscCall(LatinInterfaceSides_Private(inter));
  PetscCall(LatinInterfaceAssign_Private(inter));
  PetscCall(LatinInterfaceMates_Private(inter));
  PetscCall(LatinInterfacePrimal_Private(inter));
  PetscCall(LatinInterfaceCondensed_Private(inter));
  PetscCall(PetscLogEventEnd(LATIN_Interface, inter->sub->object, 0, 0, 0));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinInterfaceReset(LatinInterfaces *inter)
{
  PetscFunctionBegin;
  PetscCall(PetscFree(inter->interface));
  PetscCall(PetscFree(inter->offset));
  PetscCall(PetscFree(inter->node_list));
  PetscCall(PetscFree2(inter->share_offset, inter->table_offset));
  PetscCall(PetscFree(inter->share_list));
  PetscCall(PetscFree(inter->position));
  PetscCall(PetscFree3(inter->node_class, inter->component, inter->glued));
  PetscCall(PetscFree(inter->side_dof));
  PetscCall(PetscFree(inter->assigned));
  PetscCall(PetscSFDestroy(&inter->table_sf));
  PetscCall(PetscSFDestroy(&inter->mate_sf));
  PetscCall(PetscFree(inter->primal_offset));
  PetscCall(PetscFree(inter->primal_index));
  PetscCall(PetscFree(inter->primal_dof));
  PetscCall(PetscMemzero(&inter->count, sizeof(*inter) - offsetof(LatinInterfaces, count)));
  PetscFunctionReturn(0);
}
