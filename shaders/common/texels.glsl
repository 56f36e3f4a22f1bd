// Buffers of vec4s that are only read. With TEXELS, as texel buffers: some drivers load those at once, and numbers of
// storage buffers one by one.
#ifdef TEXELS
#define READ_VEC4S(number, Name) layout(set = 0, binding = number) uniform textureBuffer Name
#define VEC4_OF(Name, at) texelFetch(Name, int(at))
#else
#define READ_VEC4S(number, Name) layout(set = 0, binding = number) readonly buffer Name { vec4 vec4s[]; } Name##_
#define VEC4_OF(Name, at) Name##_.vec4s[at]
#endif
