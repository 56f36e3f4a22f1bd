// Finds the sector of a pair of lengths in a radial table (src/ops/sector_table.hpp) and what multiplies its
// columns. Needs heads[], rays[], sectors[] (or SECTOR(at), one of its vec4s) and pair_layer.glsl.
// heads    3 per table: (first ray, first sector, vec4s a sector, flags); q and eps as floats; (network's
//          parameters, its last layer's columns, 0, 0)
// rays     2^SEARCH − 1 per table: sin/(cos + sin), ascending
// sectors  each: the second variance's form (xx xy yy x), (y 1 0 0), if any; then 2 or 4 columns, a column over
//          (freq, input channels in vec4s, output channels). Networks, each: w1 gain1 bias1 w2 c2 gain2 bias2.
//          Their last layers: 32 columns, one for the offset and three of zeros
#ifndef SECTOR
#define SECTOR(at) sectors[at]
#endif

const uint SWAPPED = 1u, DEGREE1 = 2u;

struct RadialInput {
  vec4 x;        // one factor per column
  uint columns;  // where they begin
  bool network;  // eps matters: the network itself must answer
};

RadialInput radial_input(uint table, vec2 lengths) {
  const uvec4 head = heads[3 * table];
  const vec4 form = uintBitsToFloat(heads[3 * table + 1]);
  const vec2 r = (head.w & SWAPPED) != 0u ? lengths.yx : lengths;
  // On a ray itself either sector will do: the radial functions are continuous.
  const float t = r.y / max(r.x + r.y, 1e-37);
  uint sector = 0;
  for (uint step = 1u << (SEARCH - 1); step > 0u; step >>= 1)
    sector += t > rays[head.x + sector + step - 1u] ? step : 0u;
  const uint at = head.y + sector * head.z;

  // No branch: a driver may compile a shader anew for a condition that hangs on uniform memory alone.
  const bool degree1 = (head.w & DEGREE1) != 0u;
  const float trusted = 1e4 * form.w;
  const float first = form.x * r.x * r.x + form.y * r.x * r.y + form.z * r.y * r.y;
  const vec2 u = r / sqrt(first + form.w);
  const vec4 Q = SECTOR(at);
  const vec2 Q1 = SECTOR(at + 1).xy;
  const float second = Q.x * u.x * u.x + Q.y * u.x * u.y + Q.z * u.y * u.y + Q.w * u.x + Q1.x * u.y + Q1.y;
  const float v = 1.0 / sqrt(second + form.w);
  RadialInput result;
  result.x = degree1 ? vec4(r, 0, 0) : vec4(u * v, v, 1);
  result.columns = degree1 ? at : at + 2u;
  result.network = !degree1 && (!(first > trusted) || !(second > trusted));
  return result;
}
