#include "latinimpl.h"

/*
   Macro bases of the strong interfaces, section 3.2: affine displacement fields over the principal plane of the
   interface, or rigid motions, restricted to its side degrees of freedom and made orthonormal in the search direction, R^t d R = 1.

   The macro constraints of one subdomain must be independent, or its condensed operator is singular. On an irregular
   partition the interfaces of a subdomain share nodes, and primal nodes carry constraints of their own. So only those
   combinations of modes are kept that are visible on the nodes that serve the interface, see
   LatinInterfaceServing_Private().
*/

#define LATIN_MODE_RANK    LatinByPrecision(1e-6, 1e-4) /* singular values below this fraction of the largest are dependent modes */
#define LATIN_MODE_VISIBLE 1e-3                         /* a mode is kept when this part of its norm, or more, lies on the nodes that serve the interface */

/* Most modes of LatinMacroModes_Private(); in 3D 9 fields and 2 rotations */
static inline PetscInt LatinMacroModesMost(Latin latin)
{
  const LatinSubstructure *sub = &latin->sub;

  return sub->fields * PetscMax(sub->dim, 1) + PetscMax(sub->fields, sub->dim) + sub->nears;
}

/* Columns that an interface may need */
static inline PetscInt LatinMacroWidth(Latin latin, PetscInt f)
{
  return LatinMacroModesMost(latin) + (latin->floppy.count ? latin->floppy.count[f] : 0);
}

/*
   Modes at the side dofs of an interface, weighted row-wise by sqrt(d): M[row + rows * mode].
     affine  the fields of section 3.2, components x (1, xi, eta); where the nodes are not in one plane these do not
             contain the rotations about its axes: zeta e_xi and zeta e_eta complete them, or a floating subdomain
             could not move rigidly without micro energy. Fields that are no displacement do not rotate: zeta itself
             completes them.
     rigid   translations and rotations only: a smaller coarse problem
     none    no field: what is left of the coarse problem is that of FETI-DP, section 4.3
   Behind them, the near null space of a matrix that has one; it takes the place of the rigid fields.
*/
static PetscErrorCode LatinMacroModes_Private(Latin latin, const LatinInterface *face, PetscInt *modes, PetscScalar M[])
{
  LatinSubstructure *sub   = &latin->sub;
  LatinInterfaces   *inter = &latin->inter;
  const PetscInt     dim = sub->dim, rows = face->side_last - face->side_first, each = PetscMax(dim, 1);
  const PetscBool    vector = (PetscBool)(sub->fields == dim);
  const PetscReal   *near   = sub->near;
  LatinFrame         frame;
  PetscInt           planar;

  PetscFunctionBegin;
  *modes = 0;
  if (latin->modes == LATIN_MODES_NONE) PetscFunctionReturn(0);
  PetscCall(LatinInterfaceFrame_Private(sub, face->node_last - face->node_first, inter->node_list + face->node_first, &frame));
  planar = sub->fields * each;
  if (latin->modes == LATIN_MODES_RIGID && sub->nears) *modes = 0;
  else if (latin->modes == LATIN_MODES_RIGID) *modes = sub->fields + (vector ? dim * (dim - 1) / 2 : 0);
  else *modes = planar + (frame.plane ? 0 : (vector ? dim - 1 : sub->fields));
  PetscCall(PetscArrayzero(M, rows * *modes));
  for (PetscInt r = 0; r < rows; r++) {
    const PetscInt   dof = inter->side_dof[face->side_first + r], first = sub->trace ? 0 : LatinField(sub, dof), last = sub->trace ? sub->fields : first + 1;
    const PetscReal  w     = PetscSqrtReal(latin->macro.d[face->side_first + r]);
    const PetscReal *x     = sub->x + dim * (dof / sub->bs);
    PetscReal        at[3] = {0.0, 0.0, 0.0};

    if (!*modes) break;
    for (PetscInt k = 0; k < dim; k++)
      for (PetscInt b = 0; b < dim; b++) at[k] += frame.axes[k][b] * (((x[b] - frame.origin[b]) - frame.centre[b]) / frame.size);
    for (PetscInt c = first; c < last; c++) {
      const PetscReal *trace = sub->trace ? sub->trace + (1 + dim) * (c + sub->fields * dof) : NULL;
      const PetscReal  one   = trace ? trace[0] : 1.0;
      PetscReal        xi[3];

      for (PetscInt k = 0; k < dim; k++) {
        xi[k] = one * at[k];
        for (PetscInt b = 0; trace && b < dim; b++) xi[k] += frame.axes[k][b] * (trace[1 + b] / frame.size);
      }
      if (latin->modes == LATIN_MODES_RIGID) {
        PetscInt mode = sub->fields;

        M[r + rows * c] += w * one;
        for (PetscInt a = 0; a < dim && vector; a++)
          for (PetscInt b = a + 1; b < dim; b++) M[r + rows * mode++] += w * (xi[a] * frame.axes[b][c] - xi[b] * frame.axes[a][c]);
        continue;
      }
      M[r + rows * (each * c)] += w * one;
      for (PetscInt k = 0; k < dim - 1; k++) {
        M[r + rows * (each * c + 1 + k)] += w * xi[k];
        if (vector && !frame.plane) M[r + rows * (planar + k)] += w * xi[dim - 1] * frame.axes[k][c];
      }
      if (!vector && !frame.plane) M[r + rows * (planar + c)] += w * xi[dim - 1];
    }
  }
  for (PetscInt k = 0; k < sub->nears; k++) {
    PetscReal largest = 0.0;

    for (PetscInt r = 0; r < rows; r++) largest = PetscMax(largest, PetscAbsReal(near[inter->side_dof[face->side_first + r]]));
    for (PetscInt r = 0; r < rows && largest > 0.0; r++) M[r + rows * *modes] = PetscSqrtReal(latin->macro.d[face->side_first + r]) * near[inter->side_dof[face->side_first + r]] / largest;
    *modes += largest > 0.0 ? 1 : 0;
    near += sub->bs * sub->copies;
  }
  PetscFunctionReturn(0);
}

/* Right singular vectors (columns of V, modes x modes) and singular values, decreasing, of A (rows x modes), by way of its QR factor */
PetscErrorCode LatinSVD_Private(PetscInt rows, PetscInt modes, const PetscScalar A[], PetscReal s[], PetscScalar V[])
{
  PetscScalar *a, *tau, *vt, *work, dummy;
  PetscBLASInt m, n, ld, one = 1, lwork, info;

  PetscFunctionBegin;
  PetscCall(PetscBLASIntCast(modes, &n));
  PetscCall(PetscBLASIntCast(PetscMax(rows, modes), &m)); /* padded with zero rows: square at least, whatever the number of nodes */
  ld = m;
  PetscCall(PetscBLASIntCast(64 * modes, &lwork));
  PetscCall(PetscMalloc3(modes, &tau, modes * modes, &vt, lwork, &work));
  PetscCall(PetscCalloc1((size_t)m * (size_t)n, &a));
  for (PetscInt j = 0; j < modes; j++) PetscCall(PetscArraycpy(a + (size_t)m * (size_t)j, A + (size_t)rows * (size_t)j, rows));
  PetscCallBLAS("LAPACKgeqrf", LAPACKgeqrf_(&m, &n, a, &ld, tau, work, &lwork, &info));
  PetscCheck(!info, PETSC_COMM_SELF, PETSC_ERR_LIB, "LAPACK geqrf failed on the modes of an interface (info %d)", (int)info);
  for (PetscInt j = 0; j < modes; j++)
    for (PetscInt i = j + 1; i < modes; i++) a[i + ld * j] = 0.0;
  PetscCallBLAS("LAPACKgesvd", LAPACKgesvd_("N", "A", &n, &n, a, &ld, s, &dummy, &one, vt, &n, work, &lwork, &info));
  PetscCheck(!info, PETSC_COMM_SELF, PETSC_ERR_LIB, "LAPACK gesvd failed on the modes of an interface (info %d)", (int)info);
  for (PetscInt k = 0; k < modes; k++)
    for (PetscInt j = 0; j < modes; j++) V[j + modes * k] = vt[k + modes * j];
  PetscCall(PetscFree(a));
  PetscCall(PetscFree3(tau, vt, work));
  PetscFunctionReturn(0);
}

/* out (rows x n) = A (rows x modes) times the first n columns of V (modes x modes), each divided by its scale */
void LatinCombine_Private(PetscInt rows, PetscInt modes, PetscInt n, const PetscScalar A[], const PetscScalar V[], const PetscReal scale[], PetscScalar out[])
{
  for (PetscInt k = 0; k < n; k++) {
    for (PetscInt r = 0; r < rows; r++) out[r + rows * k] = 0.0;
    for (PetscInt j = 0; j < modes; j++)
      for (PetscInt r = 0; r < rows; r++) out[r + rows * k] += A[r + rows * j] * V[j + modes * k] / scale[k];
  }
}

/*
   The basis of one interface, column by column in M. First the fields that its side dofs can tell apart, orthonormal in
   d, completed by local low-energy fields where there are any (floppy.c); then, of these, the combinations whose part on the serving nodes does not vanish (singular values are cosines,
   between 0 and 1). Orthogonal combinations of an orthonormal basis are orthonormal: the result does not depend on how
   modes are scaled.
*/
static PetscErrorCode LatinMacroBasis_Private(Latin latin, PetscInt f, PetscScalar M[], PetscScalar F[])
{
  LatinInterfaces *inter = &latin->inter;
  LatinInterface  *face  = &inter->interface[f];
  const PetscInt   rows = face->side_last - face->side_first, wide = LatinMacroWidth(latin, f);
  PetscScalar     *V;
  PetscReal       *s, *one;
  PetscInt         modes = 0, fields = 0, kept = 0, serving = 0;

  PetscFunctionBegin;
  PetscCall(PetscMalloc3(wide * wide, &V, wide, &s, wide, &one));
  for (PetscInt k = 0; k < wide; k++) one[k] = 1.0;
  PetscCall(LatinMacroModes_Private(latin, face, &modes, M));
  if (modes) PetscCall(LatinSVD_Private(rows, modes, M, s, V));
  while (fields < modes && s[fields] > LATIN_MODE_RANK * s[0]) fields++;
  LatinCombine_Private(rows, modes, fields, M, V, s, F);
  modes = fields;
  PetscCall(LatinFloppyExtend(latin, f, rows, &fields, F));
  for (PetscInt r = 0; r < rows; r++) serving += inter->serves[face->side_first + r] ? 1 : 0;
  if (serving && fields) {
    for (PetscInt j = 0; j < fields; j++)
      for (PetscInt r = 0, k = 0; r < rows; r++)
        if (inter->serves[face->side_first + r]) M[k++ + serving * j] = F[r + rows * j];
    PetscCall(LatinSVD_Private(serving, fields, M, s, V));
    while (kept < fields && s[kept] > LATIN_MODE_VISIBLE) kept++;
    LatinCombine_Private(rows, fields, kept, F, V, one, M);
    for (PetscInt k = 0; k < kept; k++)
      for (PetscInt r = 0; r < rows; r++) M[r + rows * k] /= PetscSqrtReal(latin->macro.d[face->side_first + r]);
    PetscCall(LatinDirectionNormalise(latin, face, kept, M));
  }
  PetscCall(PetscFree3(V, s, one));
  face->modes = kept;
  latin->floppy.macro += PetscMax(kept - modes, 0);
  PetscFunctionReturn(0);
}

/* Does this side build the basis of the interface? */
static inline PetscBool LatinMacroBuilds(Latin latin, const LatinInterface *face)
{
  return (PetscBool)(face->strong && latin->sub.first + face->sub < face->neighbour && face->side_last > face->side_first);
}

/* (number of modes, number of the first one among the macro modes of the building rank) travel to the mates */
static PetscErrorCode LatinMacroNumber_Private(Latin latin)
{
  LatinInterfaces *inter = &latin->inter;
  PetscInt        *mine, *mate;

  PetscFunctionBegin;
  PetscCall(PetscMalloc2(2 * inter->sides, &mine, 2 * inter->sides, &mate));
  for (PetscInt f = 0; f < inter->count; f++)
    for (PetscInt k = inter->interface[f].side_first; k < inter->interface[f].side_last; k++) {
      mine[2 * k]     = inter->interface[f].modes;
      mine[2 * k + 1] = inter->interface[f].coarse_first;
    }
  PetscCall(LatinSFBcast_Private(inter->mate_sf, 2, MPIU_INT, mine, mate));
  for (PetscInt f = 0; f < inter->count; f++) {
    LatinInterface *face = &inter->interface[f];

    if (latin->sub.first + face->sub < face->neighbour || face->side_last == face->side_first) continue;
    face->modes        = mate[2 * face->side_first];
    face->coarse_first = mate[2 * face->side_first + 1];
  }
  PetscCall(PetscFree2(mine, mate));
  PetscFunctionReturn(0);
}

/* The rows of the bases: built = those of the building sides, column by column, one after the other; mode by mode to the mates */
static PetscErrorCode LatinMacroRows_Private(Latin latin, const PetscScalar built[])
{
  LatinInterfaces *inter = &latin->inter;
  LatinMacro      *macro = &latin->macro;
  PetscInt         total = 0, widest = 0;
  PetscReal       *mine, *mate;

  PetscFunctionBegin;
  for (PetscInt f = 0; f < inter->count; f++) {
    LatinInterface *face = &inter->interface[f];
    const PetscInt  rows = face->side_last - face->side_first;

    face->basis_first = total;
    total += rows * face->modes;
    widest = PetscMax(widest, face->modes);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &widest, 1, MPIU_INT, MPI_MAX, PetscObjectComm((PetscObject)latin)));
  PetscCall(PetscMalloc1(total, &macro->basis));
  PetscCall(PetscCalloc2(inter->sides, &mine, inter->sides, &mate));
  for (PetscInt j = 0; j < widest; j++) {
    size_t at = 0;

    for (PetscInt f = 0; f < inter->count; f++) {
      const LatinInterface *face = &inter->interface[f];
      const PetscInt        rows = face->side_last - face->side_first;

      if (!LatinMacroBuilds(latin, face)) continue;
      if (j < face->modes) PetscCall(PetscArraycpy(mine + face->side_first, built + at + (size_t)(rows * j), rows));
      at += (size_t)(rows * face->modes);
    }
    PetscCall(LatinSFBcast_Private(inter->mate_sf, 1, MPIU_REAL, mine, mate));
    for (PetscInt f = 0; f < inter->count; f++) {
      const LatinInterface *face  = &inter->interface[f];
      const PetscReal      *value = LatinMacroBuilds(latin, face) ? mine : mate;

      if (j < face->modes)
        for (PetscInt k = face->side_first; k < face->side_last; k++) macro->basis[face->basis_first + (k - face->side_first) * face->modes + j] = value[k];
    }
  }
  PetscCall(PetscFree2(mine, mate));
  PetscFunctionReturn(0);
}

/*
   pattern[f]: the first of the interfaces whose basis is built here that has the same one as f. A basis depends on the
   weighted fields, on D and on the nodes that serve; one with local fields is compared with none.
*/
static PetscErrorCode LatinMacroCompare_Private(Latin latin, PetscInt pattern[])
{
  LatinInterfaces *inter = &latin->inter;
  PetscReal       *data;
  size_t          *first, room = 0, n = 0;

  PetscFunctionBegin;
  for (PetscInt f = 0; f < inter->count; f++)
    if (LatinMacroBuilds(latin, &inter->interface[f])) room += (size_t)((inter->interface[f].side_last - inter->interface[f].side_first) * (LatinMacroModesMost(latin) + 1) + 3);
  PetscCall(PetscMalloc2(inter->count + 1, &first, room, &data));
  for (PetscInt f = 0; f < inter->count; f++) {
    const LatinInterface *face  = &inter->interface[f];
    PetscInt              modes = 0;

    first[f] = n * sizeof(*data);
    if (!LatinMacroBuilds(latin, face)) continue;
    PetscCall(LatinMacroModes_Private(latin, face, &modes, data + n));
    n += (size_t)((face->side_last - face->side_first) * modes);
    data[n++] = modes;
    data[n++] = face->matrix_first;
    data[n++] = latin->floppy.count && latin->floppy.count[f] ? f : -1;
    for (PetscInt k = face->side_first; k < face->side_last; k++) data[n++] = inter->serves[k] ? latin->macro.d[k] : -latin->macro.d[k];
  }
  first[inter->count] = n * sizeof(*data);
  PetscCall(LatinFindEqual(inter->count, first, data, pattern));
  PetscCall(PetscFree2(first, data));
  PetscFunctionReturn(0);
}

/* The bases of the sides that build them, column by column, one after the other, in *built; numbered from 0 on this rank */
static PetscErrorCode LatinMacroBuild_Private(Latin latin, PetscScalar *built[], PetscInt *modes)
{
  LatinInterfaces *inter = &latin->inter;
  PetscInt         next  = 0;
  size_t           used = 0, room = 0, widest = 0;
  PetscInt        *pattern;
  PetscScalar     *M, *F;

  PetscFunctionBegin;
  for (PetscInt f = 0; f < inter->count; f++) {
    const size_t size = (size_t)((inter->interface[f].side_last - inter->interface[f].side_first) * LatinMacroWidth(latin, f));

    widest = PetscMax(widest, size);
    if (LatinMacroBuilds(latin, &inter->interface[f])) room += size;
  }
  PetscCall(PetscMalloc1(room, built));
  PetscCall(PetscMalloc2(widest, &M, widest, &F));
  PetscCall(PetscMalloc1(inter->count, &pattern));
  PetscCall(LatinMacroCompare_Private(latin, pattern));
  latin->floppy.macro = 0;
  for (PetscInt f = 0; f < inter->count; f++) {
    LatinInterface *face = &inter->interface[f];

    face->modes = 0;
    if (!LatinMacroBuilds(latin, face)) continue;
    if (pattern[f] == f) {
      PetscCall(LatinMacroBasis_Private(latin, f, M, F));
      PetscCall(PetscArraycpy(*built + used, M, (face->side_last - face->side_first) * face->modes));
      face->basis_first = (PetscInt)used; /* for those equal to it */
    } else {
      face->modes       = inter->interface[pattern[f]].modes;
      face->basis_first = inter->interface[pattern[f]].basis_first;
      PetscCall(PetscArraycpy(*built + used, *built + face->basis_first, (face->side_last - face->side_first) * face->modes));
    }
    used += (size_t)((face->side_last - face->side_first) * face->modes);
    face->coarse_first = next;
    next += face->modes;
  }
  PetscCall(PetscFree2(M, F));
  PetscCall(PetscFree(pattern));
  *modes = next;
  PetscFunctionReturn(0);
}

/*
   The side of the lower subdomain builds the basis and numbers its modes; the other side receives both, so that they
   agree to the bit even where principal axes are not unique.
*/
PetscErrorCode LatinMacroSetUp(Latin latin)
{
  PetscInt     modes = 0, total[2];
  PetscScalar *built = NULL;

  PetscFunctionBegin;
  PetscCall(PetscLogEventBegin(LATIN_Macro, latin, 0, 0, 0));
  LatinEach(PetscObjectComm((PetscObject)latin), LatinMacroBuild_Private(latin, &built, &modes));
  PetscCall(LatinMacroNumber_Private(latin));
  PetscCall(LatinMacroRows_Private(latin, built));
  PetscCall(PetscFree(built));
  total[0] = modes;
  total[1] = latin->floppy.macro;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, total, 2, MPIU_INT, MPI_SUM, PetscObjectComm((PetscObject)latin)));
  latin->coarse.macro_local  = modes;
  latin->coarse.macro_global = total[0];
  latin->floppy.macro        = total[1];
  PetscCall(PetscLogEventEnd(LATIN_Macro, latin, 0, 0, 0));
  PetscFunctionReturn(0);
}

/* D R of the interfaces of the subdomains that represent others, once those share their bases */
PetscErrorCode LatinMacroDual_Private(Latin latin)
{
  LatinInterfaces *inter = &latin->inter;
  LatinMacro      *macro = &latin->macro;
  PetscInt         size = 0, longest = 0;
  PetscReal       *column;

  PetscFunctionBegin;
  for (PetscInt f = 0; f < inter->count; f++) {
    const LatinInterface *face = &inter->interface[f];

    size    = PetscMax(size, face->basis_first + (face->side_last - face->side_first) * face->modes);
    longest = PetscMax(longest, face->side_last - face->side_first);
  }
  PetscCall(PetscMalloc1(size, &macro->dual));
  PetscCall(PetscMalloc1(2 * longest, &column));
  for (PetscInt f = 0; f < inter->count; f++) {
    const LatinInterface *face = &inter->interface[f];
    const PetscInt        rows = face->side_last - face->side_first;

    if (latin->linear.blocks.pattern[face->sub] != face->sub) continue;
    for (PetscInt j = 0; j < face->modes; j++) {
      for (PetscInt r = 0; r < rows; r++) column[r] = macro->basis[face->basis_first + r * face->modes + j];
      PetscCall(LatinDirectionApply(latin, face, 1, column, rows, column + rows, rows));
      for (PetscInt r = 0; r < rows; r++) macro->dual[face->basis_first + r * face->modes + j] = column[rows + r];
    }
  }
  PetscCall(PetscFree(column));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinMacroReset(Latin latin)
{
  PetscFunctionBegin;
  PetscCall(PetscFree(latin->macro.basis));
  PetscCall(PetscFree(latin->macro.dual));
  for (PetscInt f = 0; f < latin->inter.count; f++) latin->inter.interface[f].modes = 0;
  PetscFunctionReturn(0);
}
