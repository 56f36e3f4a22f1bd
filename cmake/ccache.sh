#!/bin/sh
# ccache in front of a compiler: cmake/ccache.sh COMPILER ARGUMENT... Objects are found again in other clones of the same
# sources. GCC's precompiled headers differ from run to run: what stands for one is what it was made of, preprocessed.
export CCACHE_SLOPPINESS=pch_defines,time_macros CCACHE_PCH_EXTSUM=true CCACHE_NOHASHDIR=true
CCACHE_BASEDIR=$(cd "$(dirname "$0")/.." && pwd)
export CCACHE_BASEDIR

case " $* " in
*" -x c++-header "*) ;;
*) exec ccache "$@" ;;
esac

"$@" || exit
out=
previous=
for argument; do
  [ "$previous" = -o ] && out=$argument
  previous=$argument
done
# The later of two outputs counts.
"$@" -E -P -o "$out.preprocessed" && sha256sum <"$out.preprocessed" >"$out.sum"
rm -f "$out.preprocessed"
