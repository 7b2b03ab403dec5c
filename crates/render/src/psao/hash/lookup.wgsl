// The paper's look-up as the forward pass asks for it.

fn lookup_visibility(s: LookupInput) -> f32 {
    return hash_visibility(s.instance, s.position_rest, s.normal_rest);
}
