#include "interfaces/latininterfaces.h"

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
static inline PetscInt LatinMacroModesMost(LatinMacro *macro)
{
  const LatinSubdomains *sub = macro->sub;

  return sub->fields * PetscMax(sub->dim, 1) + PetscMax(sub->fields, sub->dim) + sub->nears;
}

/* Columns that an interface may need */
static inline PetscInt LatinMacroWidth(LatinMacro *macro, PetscInt f)
{
  return LatinMacroModesMost(macro) + (macro->spectral->count ? macro->spectral->count[f] : 0);
}

/* Appends the near null space of a matrix, each field scaled by its largest entry on the interface, weighted by sqrt(d) */
static PetscErrorCode LatinMacroNears_Private(const LatinMacro *macro, const LatinInterface *face, PetscInt *modes, PetscScalar M[])
{
  const LatinSubdomains *sub = macro->sub;
  const PetscInt        *dof = macro->inter->side_dof + face->side_first, rows = face->side_last - face->side_first;
  const PetscReal       *near = sub->near, *d = macro->dir->d + face->side_first;

  PetscFunctionBegin;
  for (PetscInt k = 0; k < sub->nears; k++, near += sub->bs * sub->copies) {
    PetscReal largest = 0.0;

    for (PetscInt r = 0; r < rows; r++) largest = PetscMax(largest, PetscAbsReal(near[dof[r]]));
    if (largest == 0.0) continue;
    for (PetscInt r = 0; r < rows; r++) M[r + rows * *modes] = PetscSqrtReal(d[r]) * near[dof[r]] / largest;
    ++*modes;
  }
  PetscFunctionReturn(0);
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
static PetscErrorCode LatinMacroModes_Private(LatinMacro *macro, const LatinInterface *face, PetscInt *modes, PetscScalar M[])
{
  const LatinSubdomains *sub   = macro->sub;
  const LatinInterfaces *inter = macro->inter;
  const PetscInt         dim = sub->dim, rows = face->side_last - face->side_first, each = PetscMax(dim, 1);
  const PetscBool        vector = (PetscBool)(sub->fields == dim);
  LatinFrame             frame;
  PetscInt               planar;

  PetscFunctionBegin;
  *modes = 0;
  PetscCall(LatinInterfaceFrame_Private(sub, face->node_last - face->node_first, inter->node_list + face->node_first, &frame));
  planar = sub->fields * each;
  if (macro->type == LATIN_MODES_RIGID && sub->nears) *modes = 0;
  else if (macro->type == LATIN_MODES_RIGID) *modes = sub->fields + (vector ? dim * (dim - 1) / 2 : 0);
  else *modes = planar + (frame.plane ? 0 : (vector ? dim - 1 : sub->fields));
  PetscCall(PetscArrayzero(M, rows * *modes));
  for (PetscInt r = 0; r < rows; r++) {
    const PetscInt   dof = inter->side_dof[face->side_first + r], c = LatinField(sub, dof);
    const PetscReal  w     = PetscSqrtReal(macro->dir->d[face->side_first + r]);
    const PetscReal *x     = sub->x + dim * (dof / sub->bs);
    PetscReal        xi[3] = {0.0, 0.0, 0.0};

    if (!*modes) break;
    for (PetscInt k = 0; k < dim; k++)
      for (PetscInt b = 0; b < dim; b++) xi[k] += frame.axes[k][b] * (((x[b] - frame.origin[b]) - frame.centre[b]) / frame.size);
    if (macro->type == LATIN_MODES_RIGID) {
      PetscInt mode = sub->fields;

      M[r + rows * c] = w;
      for (PetscInt a = 0; a < dim && vector; a++)
        for (PetscInt b = a + 1; b < dim; b++) M[r + rows * mode++] = w * (xi[a] * frame.axes[b][c] - xi[b] * frame.axes[a][c]);
      continue;
    }
    M[r + rows * (each * c)] = w;
    for (PetscInt k = 0; k < dim - 1; k++) {
      M[r + rows * (each * c + 1 + k)] = w * xi[k];
      if (vector && !frame.plane) M[r + rows * (planar + k)] = w * xi[dim - 1] * frame.axes[k][c];
    }
    if (!vector && !frame.plane) M[r + rows * (planar + c)] = w * xi[dim - 1];
  }
  PetscCall(LatinMacroNears_Private(macro, face, modes, M));
  PetscFunctionReturn(0);
}

/*
   The basis of one interface, column by column in M. First the fields that its side dofs can tell apart, orthonormal in
   d, completed by local low-energy fields where there are any (interfaces/spectralmodes.c); then, of these, the combinations whose part on the serving nodes does not vanish (singular values are cosines,
   between 0 and 1). Orthogonal combinations of an orthonormal basis are orthonormal: the result does not depend on how
   modes are scaled.
*/
static PetscErrorCode LatinMacroBasis_Private(LatinMacro *macro, PetscInt f, PetscScalar M[], PetscScalar F[])
{
  const LatinInterfaces *inter = macro->inter;
  LatinInterface        *face  = &inter->interface[f];
  const PetscInt         rows = face->side_last - face->side_first, wide = LatinMacroWidth(macro, f);
  PetscScalar           *V;
  PetscReal             *s, *one;
  PetscInt               modes = 0, fields = 0, kept = 0, serving = 0;

  PetscFunctionBegin;
  PetscCall(PetscMalloc3(wide * wide, &V, wide, &s, wide, &one));
  for (PetscInt k = 0; k < wide; k++) one[k] = 1.0;
  PetscCall(LatinMacroModes_Private(macro, face, &modes, M));
  if (modes) PetscCall(LatinSVD_Private(rows, modes, M, s, V));
  while (fields < modes && s[fields] > LATIN_MODE_RANK * s[0]) fields++;
  LatinCombine_Private(rows, modes, fields, M, V, s, F);
  modes = fields;
  PetscCall(LatinSpectralExtend(macro->spectral, f, rows, &fields, F));
  for (PetscInt r = 0; r < rows; r++) serving += inter->serves[face->side_first + r] ? 1 : 0;
  if (serving && fields) {
    for (PetscInt j = 0; j < fields; j++)
      for (PetscInt r = 0, k = 0; r < rows; r++)
        if (inter->serves[face->side_first + r]) M[k++ + serving * j] = F[r + rows * j];
    PetscCall(LatinSVD_Private(serving, fields, M, s, V));
    while (kept < fields && s[kept] > LATIN_MODE_VISIBLE) kept++;
    LatinCombine_Private(rows, fields, kept, F, V, one, M);
    for (PetscInt k = 0; k < kept; k++)
      for (PetscInt r = 0; r < rows; r++) M[r + rows * k] /= PetscSqrtReal(macro->dir->d[face->side_first + r]);
    PetscCall(LatinDirectionNormalise(macro->dir, f, kept, M));
  }
  PetscCall(PetscFree3(V, s, one));
  macro->of[f].modes = kept;
  macro->spectral_global += PetscMax(kept - modes, 0);
  PetscFunctionReturn(0);
}

/* Does this side build the basis of the interface? */
static inline PetscBool LatinMacroBuilds(LatinMacro *macro, const LatinInterface *face)
{
  return (PetscBool)(face->strong && macro->sub->first + face->sub < face->neighbour && face->side_last > face->side_first);
}

/* (number of modes, number of the first one among the macro modes of the building rank) travel to the mates */
static PetscErrorCode LatinMacroNumber_Private(LatinMacro *macro)
{
  const LatinInterfaces *inter = macro->inter;
  PetscInt              *mine, *mate;

  PetscFunctionBegin;
  PetscCall(PetscMalloc2(2 * inter->sides, &mine, 2 * inter->sides, &mate));
  for (PetscInt f = 0; f < inter->count; f++)
    for (PetscInt k = inter->interface[f].side_first; k < inter->interface[f].side_last; k++) {
      mine[2 * k]     = macro->of[f].modes;
      mine[2 * k + 1] = macro->of[f].number;
    }
  PetscCall(LatinSFBcast_Private(inter->mate_sf, 2, MPIU_INT, mine, mate));
  for (PetscInt f = 0; f < inter->count; f++) {
    LatinInterface *face = &inter->interface[f];

    if (macro->sub->first + face->sub < face->neighbour || face->side_last == face->side_first) continue;
    macro->of[f].modes  = mate[2 * face->side_first];
    macro->of[f].number = mate[2 * face->side_first + 1];
  }
  PetscCall(PetscFree2(mine, mate));
  PetscFunctionReturn(0);
}

/* The rows of the bases: built = those of the building sides, column by column, one after the other; mode by mode to the mates */
static PetscErrorCode LatinMacroRows_Private(LatinMacro *macro, const PetscScalar built[])
{
  const LatinInterfaces *inter = macro->inter;
  PetscInt               total = 0, widest = 0;
  PetscReal             *mine, *mate;

  PetscFunctionBegin;
  for (PetscInt f = 0; f < inter->count; f++) {
    LatinInterface *face = &inter->interface[f];
    const PetscInt  rows = face->side_last - face->side_first;

    macro->of[f].first = total;
    total += rows * macro->of[f].modes;
    widest = PetscMax(widest, macro->of[f].modes);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &widest, 1, MPIU_INT, MPI_MAX, PetscObjectComm(macro->sub->object)));
  PetscCall(PetscMalloc1(total, &macro->basis));
  PetscCall(PetscCalloc2(inter->sides, &mine, inter->sides, &mate));
  for (PetscInt j = 0; j < widest; j++) {
    size_t at = 0;

    for (PetscInt f = 0; f < inter->count; f++) {
      const LatinInterface *face = &inter->interface[f];
      const PetscInt        rows = face->side_last - face->side_first;

      if (!LatinMacroBuilds(macro, face)) continue;
      if (j < macro->of[f].modes) PetscCall(PetscArraycpy(mine + face->side_first, built + at + (size_t)(rows * j), rows));
      at += (size_t)(rows * macro->of[f].modes);
    }
    PetscCall(LatinSFBcast_Private(inter->mate_sf, 1, MPIU_REAL, mine, mate));
    for (PetscInt f = 0; f < inter->count; f++) {
      const LatinInterface *face  = &inter->interface[f];
      const PetscReal      *value = LatinMacroBuilds(macro, face) ? mine : mate;

      if (j < macro->of[f].modes)
        for (PetscInt k = face->side_first; k < face->side_last; k++) macro->basis[macro->of[f].first + (k - face->side_first) * macro->of[f].modes + j] = value[k];
    }
  }
  PetscCall(PetscFree2(mine, mate));
  PetscFunctionReturn(0);
}

/*
   pattern[f]: the first of the interfaces whose basis is built here that has the same one as f. A basis depends on the
   weighted fields, on D and on the nodes that serve; one with local fields is compared with none.
*/
static PetscErrorCode LatinMacroCompare_Private(LatinMacro *macro, PetscInt pattern[])
{
  const LatinInterfaces *inter = macro->inter;
  PetscReal             *data;
  size_t                *first, room = 0, n = 0;

  PetscFunctionBegin;
  for (PetscInt f = 0; f < inter->count; f++)
    if (LatinMacroBuilds(macro, &inter->interface[f])) room += (size_t)((inter->interface[f].side_last - inter->interface[f].side_first) * (LatinMacroModesMost(macro) + 1) + 3);
  PetscCall(PetscMalloc2(inter->count + 1, &first, room, &data));
  for (PetscInt f = 0; f < inter->count; f++) {
    const LatinInterface *face  = &inter->interface[f];
    PetscInt              modes = 0;

    first[f] = n * sizeof(*data);
    if (!LatinMacroBuilds(macro, face)) continue;
    PetscCall(LatinMacroModes_Private(macro, face, &modes, data + n));
    n += (size_t)((face->side_last - face->side_first) * modes);
    data[n++] = modes;
    data[n++] = macro->dir->matrix_first[f];
    data[n++] = macro->spectral->count && macro->spectral->count[f] ? f : -1;
    for (PetscInt k = face->side_first; k < face->side_last; k++) data[n++] = inter->serves[k] ? macro->dir->d[k] : -macro->dir->d[k];
  }
  first[inter->count] = n * sizeof(*data);
  PetscCall(LatinFindEqual(inter->count, first, data, pattern));
  PetscCall(PetscFree2(first, data));
  PetscFunctionReturn(0);
}

/* The bases of the sides that build them, column by column, one after the other, in *built; numbered from 0 on this rank */
static PetscErrorCode LatinMacroBuild_Private(LatinMacro *macro, PetscScalar *built[], PetscInt *modes)
{
  const LatinInterfaces *inter = macro->inter;
  PetscInt               next  = 0;
  size_t                 used = 0, room = 0, widest = 0;
  PetscInt              *pattern;
  PetscScalar           *M, *F;

  PetscFunctionBegin;
  for (PetscInt f = 0; f < inter->count; f++) {
    const size_t size = (size_t)((inter->interface[f].side_last - inter->interface[f].side_first) * LatinMacroWidth(macro, f));

    widest = PetscMax(widest, size);
    if (LatinMacroBuilds(macro, &inter->interface[f])) room += size;
  }
  PetscCall(PetscMalloc1(room, built));
  PetscCall(PetscMalloc2(widest, &M, widest, &F));
  PetscCall(PetscMalloc1(inter->count, &pattern));
  PetscCall(LatinMacroCompare_Private(macro, pattern));
  macro->spectral_global = 0;
  for (PetscInt f = 0; f < inter->count; f++) {
    LatinInterface *face = &inter->interface[f];

    macro->of[f].modes = 0;
    if (!LatinMacroBuilds(macro, face)) continue;
    if (pattern[f] == f) {
      PetscCall(LatinMacroBasis_Private(macro, f, M, F));
      PetscCall(PetscArraycpy(*built + used, M, (face->side_last - face->side_first) * macro->of[f].modes));
      macro->of[f].first = (PetscInt)used; /* for those equal to it */
    } else {
      macro->of[f].modes = macro->of[pattern[f]].modes;
      macro->of[f].first = macro->of[pattern[f]].first;
      PetscCall(PetscArraycpy(*built + used, *built + macro->of[f].first, (face->side_last - face->side_first) * macro->of[f].modes));
    }
    used += (size_t)((face->side_last - face->side_first) * macro->of[f].modes);
    macro->of[f].number = next;
    next += macro->of[f].modes;
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
PetscErrorCode LatinMacroSetUp(LatinMacro *macro)
{
  PetscInt     modes = 0, total[2];
  PetscScalar *built = NULL;

  PetscFunctionBegin;
  PetscCall(PetscLogEventBegin(LATIN_Macro, macro->sub->object, 0, 0, 0));
  PetscCall(PetscCalloc1(macro->inter->count, &macro->of));
  LatinEach(PetscObjectComm(macro->sub->object), LatinMacroBuild_Private(macro, &built, &modes));
  PetscCall(LatinMacroNumber_Private(macro));
  PetscCall(LatinMacroRows_Private(macro, built));
  PetscCall(PetscFree(built));
  for (PetscInt s = 0; s < macro->sub->n; s++)
    for (PetscInt f = macro->inter->offset[s], at = 0; f < macro->inter->offset[s + 1]; at += macro->of[f++].modes) macro->of[f].at = at;
  total[0] = modes;
  total[1] = macro->spectral_global;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, total, 2, MPIU_INT, MPI_SUM, PetscObjectComm(macro->sub->object)));
  macro->modes_local     = modes;
  macro->modes_global    = total[0];
  macro->spectral_global = total[1];
  PetscCall(PetscLogEventEnd(LATIN_Macro, macro->sub->object, 0, 0, 0));
  PetscFunctionReturn(0);
}

/* Bases of equal subdomains are kept once: they are read in one place, where they stay in cache */
static PetscErrorCode LatinMacroShareBases_Private(LatinMacro *macro, const PetscInt pattern[])
{
  const LatinInterfaces *inter = macro->inter;
  PetscInt               total = 0;
  PetscReal             *basis;

  PetscFunctionBegin;
  for (PetscInt f = 0; f < inter->count; f++)
    if (pattern[inter->interface[f].sub] == inter->interface[f].sub) total += (inter->interface[f].side_last - inter->interface[f].side_first) * macro->of[f].modes;
  PetscCall(PetscMalloc1(total, &basis));
  total = 0;
  for (PetscInt f = 0; f < inter->count; f++) {
    const LatinInterface *face = &inter->interface[f];
    const PetscInt        size = (face->side_last - face->side_first) * macro->of[f].modes, own = inter->offset[face->sub], other = inter->offset[pattern[face->sub]];

    if (own != other) {
      macro->of[f].first = macro->of[f + other - own].first; /* the pattern is the first subdomain of its kind */
      continue;
    }
    PetscCall(PetscArraycpy(basis + total, macro->basis + macro->of[f].first, size));
    macro->of[f].first = total;
    total += size;
  }
  PetscCall(PetscFree(macro->basis));
  macro->basis = basis;
  PetscFunctionReturn(0);
}

/* D R of the interfaces of the subdomains that represent others, once those share their bases */
static PetscErrorCode LatinMacroDual_Private(LatinMacro *macro, const PetscInt pattern[])
{
  const LatinInterfaces *inter = macro->inter;
  PetscInt               size = 0, longest = 0;
  PetscReal             *column;

  PetscFunctionBegin;
  for (PetscInt f = 0; f < inter->count; f++) {
    const LatinInterface *face = &inter->interface[f];

    size    = PetscMax(size, macro->of[f].first + (face->side_last - face->side_first) * macro->of[f].modes);
    longest = PetscMax(longest, face->side_last - face->side_first);
  }
  PetscCall(PetscMalloc1(size, &macro->dual));
  PetscCall(PetscMalloc1(2 * longest, &column));
  for (PetscInt f = 0; f < inter->count; f++) {
    const LatinInterface *face = &inter->interface[f];
    const PetscInt        rows = face->side_last - face->side_first;

    if (pattern[face->sub] != face->sub) continue;
    for (PetscInt j = 0; j < macro->of[f].modes; j++) {
      for (PetscInt r = 0; r < rows; r++) column[r] = macro->basis[macro->of[f].first + r * macro->of[f].modes + j];
      PetscCall(LatinDirectionApply(macro->dir, f, 1, column, rows, column + rows, rows));
      for (PetscInt r = 0; r < rows; r++) macro->dual[macro->of[f].first + r * macro->of[f].modes + j] = column[rows + r];
    }
  }
  PetscCall(PetscFree(column));
  PetscFunctionReturn(0);
}

/* Shares the bases of equal subdomains, pattern[s] the first of them, and computes their duals */
PetscErrorCode LatinMacroShare_Private(LatinMacro *macro, const PetscInt pattern[])
{
  PetscFunctionBegin;
  PetscCall(LatinMacroShareBases_Private(macro, pattern));
  PetscCall(LatinMacroDual_Private(macro, pattern));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinMacroReset(LatinMacro *macro)
{
  PetscFunctionBegin;
  PetscCall(PetscFree(macro->of));
  PetscCall(PetscFree(macro->basis));
  PetscCall(PetscFree(macro->dual));
  PetscFunctionReturn(0);
}
