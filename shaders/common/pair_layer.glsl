// Sizes of a two-sided layer, by degree in the order (0,0), (0,1), (1,0), (1,1), and how its radial tables are
// numbered: by degree out, then by degree in, twice where both are symmetric; values, then keys, if they are
// computed apart. src/vk/pair_tables.cpp packs them.
layout(constant_id = 3) const int IN0 = 4;
layout(constant_id = 4) const int IN1 = 4;
layout(constant_id = 5) const int IN2 = 4;
layout(constant_id = 6) const int IN3 = 4;
layout(constant_id = 7) const int VALUES0 = 2;
layout(constant_id = 8) const int VALUES1 = 2;
layout(constant_id = 9) const int VALUES2 = 2;
layout(constant_id = 10) const int VALUES3 = 2;
layout(constant_id = 11) const int KEYS0 = 2;
layout(constant_id = 12) const int KEYS1 = 2;
layout(constant_id = 13) const int KEYS2 = 2;
layout(constant_id = 14) const int KEYS3 = 2;
layout(constant_id = 15) const bool LINEAR = false;  // values of scale degree 1, so apart from the keys
layout(constant_id = 16) const int SEARCH = 6;       // tables have fewer than 2^SEARCH rays

#define PICK(d, a, b, c, e) ((d) == 0 ? (a) : (d) == 1 ? (b) : (d) == 2 ? (c) : (e))
#define IN_CHANNELS(d) PICK(d, IN0, IN1, IN2, IN3)
#define VALUES(d) PICK(d, VALUES0, VALUES1, VALUES2, VALUES3)
#define KEYS(d) PICK(d, KEYS0, KEYS1, KEYS2, KEYS3)
#define MESSAGES(d) (VALUES(d) + KEYS(d))
#define DIM(d) PICK(d, 1, 3, 3, 9)

// Where degrees begin in a row of features.
const int FEATURE1 = IN0, FEATURE2 = FEATURE1 + 3 * IN1, FEATURE3 = FEATURE2 + 3 * IN2;
const int FEATURE_STRIDE = (FEATURE3 + 9 * IN3 + 3) / 4 * 4;
#define FEATURE(d) PICK(d, 0, FEATURE1, FEATURE2, FEATURE3)

// Where degrees begin in an edge's messages: [values ; keys] by degree, channel, component.
const int MESSAGE1 = VALUES0 + KEYS0, MESSAGE2 = MESSAGE1 + 3 * (VALUES1 + KEYS1);
const int MESSAGE3 = MESSAGE2 + 3 * (VALUES2 + KEYS2);
const int MESSAGE_COUNT = MESSAGE3 + 9 * (VALUES3 + KEYS3);
const int MESSAGE_STRIDE = (MESSAGE_COUNT + 3) / 4 * 4;
#define MESSAGE(d) PICK(d, 0, MESSAGE1, MESSAGE2, MESSAGE3)

// Vec4s that hold the input channels of any degree.
const int IN_01 = IN0 > IN1 ? IN0 : IN1, IN_23 = IN2 > IN3 ? IN2 : IN3;
const int IN4 = ((IN_01 > IN_23 ? IN_01 : IN_23) + 3) / 4;

const int SET = 20;
const int TABLES = LINEAR ? 2 * SET : SET;
#define SYMMETRIC(d) ((d) == 0 || (d) == 3)
#define TABLES_OF(in, out) (SYMMETRIC(in) && SYMMETRIC(out) ? 2 : 1)
#define FIRST_TABLE(in, out) (PICK(out, 0, 6, 10, 14) + (in) + (SYMMETRIC(out) && (in) > 0 ? 1 : 0))
