# cmake -DSPIRV=FILE -DOUT=FILE -P spirv_words.cmake: the words of little-endian SPIR-V as C++ numbers.
file(READ ${SPIRV} bytes HEX)
string(REGEX REPLACE "(..)(..)(..)(..)" "0x\\4\\3\\2\\1,\n" words "${bytes}")
file(WRITE ${OUT} "${words}")
