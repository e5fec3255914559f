// Laws of kernels_isa.inl, which includes this file: the energy, stress and tangent of one register's elements.

#include "runtime/kernels/materials_isa.inl"

/// One of the examples of a law: H - H_k, times A_k where there is one, and its weight.
struct Reference {
  const double* shift;
  const double* inverse;  ///< null: the identity, of volume 1
  Vec weight;

  Reference(const ElementLaw& law, Index at, Index k)
      : shift(law.shifts + place(law, at, k, 9)),
        inverse(law.inverses == nullptr ? nullptr : law.inverses + place(law, at, k, kInverseNumbers)),
        weight(zero() + law.shift_weights[k]) {
    if (inverse != nullptr) weight *= load(inverse + 9 * kLanes);
  }

  void displacement_gradient(const Vec* H, Vec* own) const {
    Vec shifted[9];
    for (Index i = 0; i < 9; ++i) shifted[i] = H[i] - load(shift + i * kLanes);
    for (Index a = 0; a < 3; ++a)
      for (Index b = 0; b < 3; ++b)
        own[3 * a + b] = inverse == nullptr
                             ? shifted[3 * a + b]
                             : shifted[3 * a] * A(0, b) + shifted[3 * a + 1] * A(1, b) + shifted[3 * a + 2] * A(2, b);
  }

  /// P += P' A^T, tangent += (I (x) A) tangent' (I (x) A^T).
  template <Want want>
  void add(const Vec* own_P, const double* own_tangent, Vec* P, double* tangent) const {
    for (Index a = 0; a < 3; ++a)
      for (Index b = 0; b < 3; ++b)
        P[3 * a + b] += own_P[3 * a] * A(b, 0) + own_P[3 * a + 1] * A(b, 1) + own_P[3 * a + 2] * A(b, 2);
    if constexpr (want == Want::kStiffness)
      for (Index a = 0; a < 3; ++a)
        for (Index c = a; c < 3; ++c) add_block(own_tangent, a, c, tangent);
  }

 private:
  static Index place(const ElementLaw& law, Index at, Index k, Index numbers) {
    return (at / kLanes * law.shift_count + k) * numbers * kLanes + at % kLanes;
  }

  Vec A(Index i, Index j) const { return load(inverse + (3 * i + j) * kLanes); }

  /// The 3 x 3 block of rows 3a and columns 3c: A times the block times A^T.
  void add_block(const double* own_tangent, Index a, Index c, double* tangent) const {
    Vec left[9];  // A times the block
    for (Index l = 0; l < 3; ++l) {
      Vec column[3];
      for (Index k = 0; k < 3; ++k) column[k] = load(own_tangent + triangle_entry<9>(3 * a + k, 3 * c + l) * kLanes);
      for (Index b = 0; b < 3; ++b) left[3 * b + l] = A(b, 0) * column[0] + A(b, 1) * column[1] + A(b, 2) * column[2];
    }
    for (Index b = 0; b < 3; ++b)
      for (Index d = a == c ? b : 0; d < 3; ++d)
        add_to(tangent + triangle_entry<9>(3 * a + b, 3 * c + d) * kLanes,
               left[3 * b] * A(d, 0) + left[3 * b + 1] * A(d, 1) + left[3 * b + 2] * A(d, 2));
  }
};

template <Want want>
inline void clear_result(Vec* P, double* tangent) {
  for (Index i = 0; i < 9; ++i) P[i] = zero();
  if constexpr (want == Want::kStiffness)
    for (Index i = 0; i < kTangentNumbers; ++i) store(tangent + i * kLanes, zero());
}

/// Energy by one material; adds the stress to P and sets the tangent, as wanted.
template <Want want, class Law>
inline Vec evaluate_one(const Law& law, const Vec* H, Vec* P, double* tangent) {
  Vec inputs[Law::kTangentInputs];
  const Vec energy = law.template evaluate<want>(H, P, inputs);
  if constexpr (want == Want::kStiffness)
    law.tangent(inputs, [&](Index entry, Vec value) { store(tangent + entry * kLanes, value); });
  return energy;
}

/// The sum over the law's examples.
template <Want want, class Material>
inline Vec evaluate_examples(const ElementLaw& law, Index at, const Vec* H, Vec* P, double* tangent) {
  alignas(kAlignment) double own_tangent[want == Want::kStiffness ? kTangentNumbers * kLanes : kLanes];
  clear_result<want>(P, tangent);
  Vec energy = zero();
  for (Index k = 0; k < law.shift_count; ++k) {
    if (law.shift_weights[k] == 0) continue;
    const Reference reference(law, at, k);
    const Material material{reference.weight * load(law.mu + at), reference.weight * load(law.lambda + at)};
    Vec own[9], own_P[9] = {};
    reference.displacement_gradient(H, own);
    energy += evaluate_one<want>(material, own, reference.inverse == nullptr ? P : own_P, own_tangent);
    if (reference.inverse != nullptr)
      if constexpr (want != Want::kEnergy) reference.add<want>(own_P, own_tangent, P, tangent);
    if constexpr (want == Want::kStiffness)
      for (Index i = 0; reference.inverse == nullptr && i < kTangentNumbers; ++i)
        add_to(tangent + i * kLanes, load(own_tangent + i * kLanes));
  }
  return energy;
}

/// Energy of one register's elements by the law; sets P and the tangent, as wanted.
template <Want want, class Law>
inline Vec evaluate_law(const ElementLaw& law, Index at, const Vec* H, Vec* P, double* tangent) {
  clear_result<Want::kForce>(P, nullptr);
  if constexpr (std::is_same_v<Law, Quadratic>) {
    return evaluate_one<want>(Quadratic{law.quadratic + (at / kLanes * kQuadraticNumbers) * kLanes + at % kLanes}, H, P,
                              tangent);
  } else {
    if (law.shift_count > 0) return evaluate_examples<want, Law>(law, at, H, P, tangent);
    return evaluate_one<want>(Law{load(law.mu + at), load(law.lambda + at)}, H, P, tangent);
  }
}

/// work with the type of the law: chosen once for all elements.
template <class Work>
inline auto with_law(const ElementLaw& law, Work work) {
  switch (law.kind) {
    case ElementLaw::Kind::kQuadraticInGreenStrain:
      return work.template operator()<Quadratic>();
    case ElementLaw::Kind::kStableNeoHookean:
      return work.template operator()<StableNeoHookean>();
    case ElementLaw::Kind::kCorotational:
      return work.template operator()<Corotational>();
    case ElementLaw::Kind::kStVenantKirchhoff:
      break;
  }
  return work.template operator()<StVenantKirchhoff>();
}
