// What the gradient of a two-sided layer keeps between its shaders. A node's record is by degree and component,
// channels padded to vec4s: src/vk/pair_attention_gradient.cpp counts the same.
#define PADDED(n) (((n) + 3) / 4 * 4)

// An edge's record, an edge after the other. In its frames: features by component 4·a + b, a and b of 0 | 1 2 3, in
// vec4s of channels, and the gradients of messages. For every radial table: what multiplies its columns, its sector;
// then the two lengths as one more table. Gradients of coefficients and of features, block by block, as the columns
// have them.
#define COMPONENT(a, b) (4 * (a) + (b))

// Frequencies and components that a block couples on one side; from 1 to 1: the axis to the axis, then the identity and
// 𝒥 on the plane across it.
bool couples(int n, int i_out, int i_in) { return n == 1 || (i_out == 0) == (i_in == 0); }
int frequency(int i_out, int i_in) { return i_out == 0 ? 0 : i_out == i_in ? 1 : 2; }
float side_sign(int i_out, int i_in) { return i_out == 1 && i_in == 2 ? -1.0 : 1.0; }
