#include "interfaces/latininterfaces.h"

/*
   Macro bases of the strong interfaces, section 3.2: affine displacement fields over the principal plane of the interface, or rigid motions, restricted
   to its side dofs and made orthonormal in the search direction, R^t D R = 1.

   The macro constraints of a subdomain must be independent, or its condensed operator is singular. On an irregular partition the interfaces of a
   subdomain share nodes, and primal nodes carry constraints of their own. So combinations of modes are kept only if they do not vanish on the nodes
   assigned to the interface, see LatinInterfaceAssign_Private().
*/

#define LATIN_MODE_RANK LatinByPrecision(1e-6, 1e-4) /* least singular value of independent modes, relative to the largest */
/* least part of the norm of a mode on the nodes assigned to the interface; any value from 6e-5 to 0.016 keeps the same modes */
#define LATIN_MODE_VISIBLE 1e-3

/* Returns an upper bound of the number of modes of LatinMacroModes_Private() */
static inline PetscInt LatinMacroModesMost(LatinMacro *macro)
{
  const LatinSubdomains *sub = macro->sub;

  return sub->fields * PetscMax(sub->dim, 1) + PetscMax(sub->fields, sub->dim) + sub->nears;
}

/* Returns an upper bound of the number of columns of the basis of interface f */
static inline PetscInt LatinMacroWidth(LatinMacro *macro, PetscInt f)
{
  return LatinMacroModesMost(macro) + (macro->spectral->count ? macro->spectral->count[f] : 0);
}

/* Appends the near null space of a matrix to M: each vector scaled by its largest entry on the interface, rows weighted by sqrt(d) */
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
   Computes the modes at the side dofs of an interface, M[row + rows * mode], *modes of them, rows weighted by sqrt(d).

     affine  the fields of section 3.2, components x (1, xi, eta). If the nodes are not in one plane, zeta e_xi and zeta e_eta are added: without them the
             fields contain no rotation about the axes of the principal plane, and a rigid-body motion of a floating subdomain has micro energy. For fields
             that are no displacement, zeta of each is added.
     rigid   translations and rotations only: a smaller coarse problem

   The near null space of a matrix follows; with type rigid it replaces the rigid-body modes.
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
   Builds the basis of interface f, column-major in M. Sets its number of modes and adds to macro->spectral_global. F: work.

   1. SVD of the modes on the side dofs: independent fields, orthonormal in d;
   2. completed by local low-energy fields, if any (interfaces/spectralmodes.c);
   3. SVD of the rows of assigned nodes: combinations that do not vanish there (singular values are cosines, from 0 to 1).

   Orthogonal combinations of an orthonormal basis are orthonormal: the scaling of modes does not matter.
*/
static PetscErrorCode LatinMacroBasis_Private(LatinMacro *macro, PetscInt f, PetscScalar M[], PetscScalar F[])
{
  const LatinInterfaces *inter = macro->inter;
  LatinInterface        *face  = &inter->interface[f];
  const PetscInt         rows = face->side_last - face->side_first, wide = LatinMacroWidth(macro, f);
  PetscScalar           *V;
  PetscReal             *s, *one;
  PetscInt               modes = 0, fields = 0, kept = 0, assigned = 0;

  PetscFunctionBegin;
  PetscCall(PetscMalloc3(wide * wide, &V, wide, &s, wide, &one));
  for (PetscInt k = 0; k < wide; k++) one[k] = 1.0;
  PetscCall(LatinMacroModes_Private(macro, face, &modes, M));
  if (modes) PetscCall(LatinSVD_Private(rows, modes, M, s, V));
  while (fields < modes && s[fields] > LATIN_MODE_RANK * s[0]) fields++;
  LatinCombine_Private(rows, modes, fields, M, V, s, F);
  modes = fields;
  PetscCall(LatinSpectralExtend(macro->spectral, f, rows, &fields, F));
  for (PetscInt r = 0; r < rows; r++) assigned += inter->assigned[face->side_first + r] ? 1 : 0;
  if (assigned && fields) {
    for (PetscInt j = 0; j < fields; j++)
      for (PetscInt r = 0, k = 0; r < rows; r++)
        if (inter->assigned[face->side_first + r]) M[k++ + assigned * j] = F[r + rows * j];
    PetscCall(LatinSVD_Private(assigned, fields, M, s, V));
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

/* Whether this side builds the basis of the interface: that of the lower subdomain does */
static inline PetscBool LatinMacroBuilds(LatinMacro *macro, const LatinInterface *face)
{
  return (PetscBool)(face->strong && macro->sub->first + face->sub < face->neighbour && face->side_last > face->side_first);
}

/*
   Sets pattern[f] to the first interface built here with the same basis as f. A basis depends on the weighted fields, on D and on the nodes assigned to
   the interface; bases with local low-energy fields are not compared.
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
    for (PetscInt k = face->side_first; k < face->side_last; k++) data[n++] = inter->assigned[k] ? macro->dir->d[k] : -macro->dir->d[k];
  }
  first[inter->count] = n * sizeof(*data);
  PetscCall(LatinFindEqual(inter->count, first, data, pattern));
  PetscCall(PetscFree2(first, data));
  PetscFunctionReturn(0);
}

/* Builds the bases mine[f] of this side, column-major, equal ones once, in *built, which the caller frees. Their modes are numbered from 0 on this rank */
static PetscErrorCode LatinMacroBuild_Private(LatinMacro *macro, const PetscReal *mine[], PetscScalar *built[])
{
  const LatinInterfaces *inter = macro->inter;
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
  macro->spectral_global = macro->modes_local = 0;
  for (PetscInt f = 0; f < inter->count; f++) {
    const LatinInterface *face = &inter->interface[f];
    const PetscInt        rows = face->side_last - face->side_first;

    if (!LatinMacroBuilds(macro, face)) continue;
    if (pattern[f] == f) {
      PetscCall(LatinMacroBasis_Private(macro, f, M, F));
      PetscCall(PetscArraycpy(*built + used, M, rows * macro->of[f].modes));
      mine[f] = *built + used;
      used += (size_t)(rows * macro->of[f].modes);
    } else {
      macro->of[f].modes = macro->of[pattern[f]].modes;
      mine[f]            = mine[pattern[f]];
    }
    macro->of[f].number = macro->modes_local;
    macro->modes_local += macro->of[f].modes;
  }
  PetscCall(PetscFree2(M, F));
  PetscCall(PetscFree(pattern));
  PetscFunctionReturn(0);
}

/*
   Gathers the bases of all sides in macro->basis, column-major: mine[f] of those built here; the others, and the numbers of their modes, come from the
   mates. Collective on sub->object
*/
static PetscErrorCode LatinMacroCollect_Private(LatinMacro *macro, const PetscReal *const mine[])
{
  const LatinInterfaces *inter = macro->inter;
  PetscInt              *modes, *theirs, *number, total = 0;
  size_t                *first;
  PetscReal             *mate;

  PetscFunctionBegin;
  PetscCall(PetscMalloc4(inter->count, &modes, inter->count, &theirs, inter->count, &number, inter->count + 1, &first));
  for (PetscInt f = 0; f < inter->count; f++) {
    modes[f]  = macro->of[f].modes;
    number[f] = macro->of[f].number;
  }
  PetscCall(LatinMateNumbers_Private(inter, number, number));
  PetscCall(LatinMateColumns_Private(inter, modes, mine, theirs, first, &mate));
  for (PetscInt f = 0; f < inter->count; f++) {
    if (!LatinMacroBuilds(macro, &inter->interface[f])) {
      macro->of[f].modes  = theirs[f];
      macro->of[f].number = number[f];
    }
    macro->of[f].first = total;
    total += (inter->interface[f].side_last - inter->interface[f].side_first) * macro->of[f].modes;
  }
  PetscCall(PetscMalloc1(total, &macro->basis));
  for (PetscInt f = 0; f < inter->count; f++) {
    const LatinInterface *face = &inter->interface[f];

    PetscCall(PetscArraycpy(macro->basis + macro->of[f].first, LatinMacroBuilds(macro, face) ? mine[f] : mate + first[f], (face->side_last - face->side_first) * macro->of[f].modes));
  }
  PetscCall(PetscFree(mate));
  PetscCall(PetscFree4(modes, theirs, number, first));
  PetscFunctionReturn(0);
}

/*
   Computes the macro bases. The side of the lower subdomain builds a basis and numbers its modes; the other side receives both. So they agree to the
   bit even if principal axes are not unique. Call LatinMacroShare_Private() afterwards. Collective on sub->object
*/
PetscErrorCode LatinMacroSetUp(LatinMacro *macro)
{
  MPI_Comm          comm  = PetscObjectComm(macro->sub->object);
  PetscScalar      *built = NULL;
  const PetscReal **mine;
  PetscInt          total[2];

  PetscFunctionBegin;
  PetscCall(PetscLogEventBegin(LATIN_Macro, macro->sub->object, 0, 0, 0));
  PetscCall(PetscCalloc1(macro->inter->count, &macro->of));
  PetscCall(PetscCalloc1(macro->inter->count, &mine));
  LatinEach(comm, LatinMacroBuild_Private(macro, mine, &built));
  PetscCall(LatinMacroCollect_Private(macro, mine));
  PetscCall(PetscFree(built));
  PetscCall(PetscFree(mine));
  for (PetscInt s = 0; s < macro->sub->n; s++)
    for (PetscInt f = macro->inter->offset[s], at = 0; f < macro->inter->offset[s + 1]; at += macro->of[f++].modes) macro->of[f].at = at;
  total[0] = macro->modes_local;
  total[1] = macro->spectral_global;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, total, 2, MPIU_INT, MPI_SUM, comm));
  macro->modes_global    = total[0];
  macro->spectral_global = total[1];
  PetscCall(PetscLogEventEnd(LATIN_Macro, macro->sub->object, 0, 0, 0));
  PetscFunctionReturn(0);
}

/* Makes the bases row-major and computes D R. Equal subdomains, pattern[s] the first of them, share one copy, which stays in cache. */
PetscErrorCode LatinMacroShare_Private(LatinMacro *macro, const PetscInt pattern[])
{
  const LatinInterfaces *inter = macro->inter;
  PetscInt               total = 0, largest = 0;
  PetscReal             *columns = macro->basis, *dual;

  PetscFunctionBegin;
  for (PetscInt f = 0; f < inter->count; f++) {
    const PetscInt size = (inter->interface[f].side_last - inter->interface[f].side_first) * macro->of[f].modes;

    if (pattern[inter->interface[f].sub] == inter->interface[f].sub) total += size;
    largest = PetscMax(largest, size);
  }
  PetscCall(PetscMalloc1(total, &macro->basis));
  PetscCall(PetscMalloc1(total, &macro->dual));
  PetscCall(PetscMalloc1(largest, &dual));
  total = 0;
  for (PetscInt f = 0; f < inter->count; f++) {
    const LatinInterface *face = &inter->interface[f];
    LatinFaceModes       *of   = &macro->of[f];
    const PetscInt        rows = face->side_last - face->side_first, own = inter->offset[face->sub], other = inter->offset[pattern[face->sub]];
    const PetscReal      *R = columns + of->first;

    if (own != other) {
      of->first = macro->of[f + other - own].first; /* the pattern is the first subdomain of its kind */
      continue;
    }
    PetscCall(LatinDirectionApply(macro->dir, f, of->modes, R, rows, dual, rows));
    of->first = total;
    for (PetscInt r = 0; r < rows; r++)
      for (PetscInt j = 0; j < of->modes; j++, total++) {
        macro->basis[total] = R[r + rows * j];
        macro->dual[total]  = dual[r + rows * j];
      }
  }
  PetscCall(PetscFree(columns));
  PetscCall(PetscFree(dual));
  PetscFunctionReturn(0);
}

/* Replaces displacements x on interface f by their micro part, (1 - R R^t D) x, or forces by (1 - D R R^t) x. work: [modes] */
void LatinMacroMicro(const LatinMacro *macro, PetscInt f, PetscBool forces, PetscReal x[], PetscReal work[])
{
  const PetscInt   modes = macro->of[f].modes, rows = macro->inter->interface[f].side_last - macro->inter->interface[f].side_first;
  const PetscReal *R = macro->basis + macro->of[f].first, *DR = macro->dual + macro->of[f].first;
  const PetscReal *out = forces ? R : DR, *in = forces ? DR : R;

  for (PetscInt j = 0; j < modes; j++) work[j] = 0.0;
  for (PetscInt r = 0; r < rows; r++)
    for (PetscInt j = 0; j < modes; j++) work[j] += out[modes * r + j] * x[r];
  for (PetscInt r = 0; r < rows; r++)
    for (PetscInt j = 0; j < modes; j++) x[r] -= in[modes * r + j] * work[j];
}

PetscErrorCode LatinMacroReset(LatinMacro *macro)
{
  PetscFunctionBegin;
  PetscCall(PetscFree(macro->of));
  PetscCall(PetscFree(macro->basis));
  PetscCall(PetscFree(macro->dual));
  PetscFunctionReturn(0);
}
