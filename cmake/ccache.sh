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
# The same again, preprocessed: without the output and what is written of dependencies.
out=
count=$#
while [ "$count" -gt 0 ]; do
  case $1 in
  -o)
    out=$2
    shift 2
    count=$((count - 2))
    ;;
  -MD | -c)
    shift
    count=$((count - 1))
    ;;
  -MT | -MF)
    shift 2
    count=$((count - 2))
    ;;
  *)
    set -- "$@" "$1"
    shift
    count=$((count - 1))
    ;;
  esac
done
"$@" -E -P | sha256sum >"$out.sum"
