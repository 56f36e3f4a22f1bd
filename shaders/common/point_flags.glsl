// FLAGS of a one-sided layer's shaders, once for GLSL and for C++ (src/vk/point_flags.hpp).
#ifndef BITR_POINT_FLAGS
#define BITR_POINT_FLAGS

const uint POINT_UNIFORM = 1u;
const uint POINT_DIRECTION = 2u;
const uint POINT_PER_CLOUD = 4u;
const uint POINT_RELU = 8u;
const uint POINT_VECTOR_KEYS = 16u;
const uint POINT_RELU_SQUARE = 32u;
const uint POINT_KEEP = 64u;       // leaves its sums for the gradient
// What the gradient's shaders alone are told:
const uint POINT_ZERO = 128u;      // tiles that have edges of length zero
const uint POINT_CONSTANT = 256u;  // one feature for all points, the last of weights[]
const uint POINT_FEATURES = 512u;  // their gradient is wanted
const uint POINT_CENTRES = 1024u;  // that of the centres is
const uint POINT_KEPT = 2048u;     // the layer has left its sums, but for edges of length zero

#endif
