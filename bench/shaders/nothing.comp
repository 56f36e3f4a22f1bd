// nothing.comp: does nothing, so that what a dispatch itself costs can be seen.
// spec 0 WORKGROUP=1 | grid any | shared 0 KiB | loops none
#version 450

layout(local_size_x_id = 0) in;

void main() {}
