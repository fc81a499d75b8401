/* Bad worlds, and what is said about each, word by word: for test_diagnostics.c. */
#ifndef KARST_TESTS_LANGUAGE_DIAGNOSTIC_TEXTS_H
#define KARST_TESTS_LANGUAGE_DIAGNOSTIC_TEXTS_H

static const struct {
    const char *name, *text, *said;
} cases[] = {
    {"misspelt_function",
     "float density(vec3 p) {\n"
     "    return nois(p);\n"
     "}\n",
     "world.karst:2:12: error: there is no function 'nois'\n"
     "      return nois(p);\n"
     "             ^\n"
     "  did you mean 'noise'?"},
    {"swapped_letters", /* as near to fma as to fbm, by letters that differ */
     "float density(vec3 p) {\n"
     "    return fmb(p, 4) - p.y;\n"
     "}\n",
     "world.karst:2:12: error: there is no function 'fmb'\n"
     "      return fmb(p, 4) - p.y;\n"
     "             ^\n"
     "  did you mean 'fbm'?"},
    {"misspelt_variable",
     "float density(vec3 p) {\n"
     "    float height = 2.0;\n"
     "    return heigth - p.y;\n"
     "}\n",
     "world.karst:3:12: error: there is no variable 'heigth'\n"
     "      return heigth - p.y;\n"
     "             ^\n"
     "  did you mean 'height'?"},
    {"unknown_variable",
     "float density(vec3 p) {\n"
     "    return zebra;\n"
     "}\n",
     "world.karst:2:12: error: there is no variable 'zebra'\n"
     "      return zebra;\n"
     "             ^"},
    {"missing_semicolon",
     "float density(vec3 p) {\n"
     "    float a = 1.0\n"
     "    return a;\n"
     "}\n",
     "world.karst:2:18: error: expected ';' behind the statement, not 'return'\n"
     "      float a = 1.0\n"
     "                   ^"},
    {"vector_to_float",
     "float density(vec3 p) {\n"
     "    float a = p;\n"
     "    return a;\n"
     "}\n",
     "world.karst:2:15: error: this variable needs a float, not a vec3\n"
     "      float a = p;\n"
     "                ^\n"
     "  take a part of it, such as .x"},
    {"float_to_int",
     "float density(vec3 p) {\n"
     "    int i = p.x;\n"
     "    return float(i);\n"
     "}\n",
     "world.karst:2:15: error: this variable needs an int, not a float\n"
     "      int i = p.x;\n"
     "                ^\n"
     "  write int(...)"},
    {"int_and_bool",
     "float density(vec3 p) {\n"
     "    int i = 1; bool u = true;\n"
     "    return float(i + u);\n"
     "}\n",
     "world.karst:3:20: error: '+' does not go between int and bool\n"
     "      return float(i + u);\n"
     "                     ^\n"
     "  write int(...) around one of them"},
    {"wrong_sizes",
     "float density(vec3 p) {\n"
     "    vec2 a = vec2(1.0);\n"
     "    return length(p * a);\n"
     "}\n",
     "world.karst:3:21: error: '*' does not go between vec3 and vec2\n"
     "      return length(p * a);\n"
     "                      ^"},
    {"unknown_type", "flaot density(vec3 p) { return 0.0; }\n",
     "world.karst:1:1: error: there is no type 'flaot'\n"
     "  flaot density(vec3 p) { return 0.0; }\n"
     "  ^\n"
     "  did you mean 'float'?"},
    {"unknown_component",
     "float density(vec3 p) {\n"
     "    return p.q;\n"
     "}\n",
     "world.karst:2:14: error: a vec3 has no component 'q'\n"
     "      return p.q;\n"
     "               ^\n"
     "  it has stp"},
    {"mixed_components",
     "float density(vec3 p) {\n"
     "    return p.xg;\n"
     "}\n",
     "world.karst:2:14: error: a vec3 has no '.xg'\n"
     "      return p.xg;\n"
     "               ^\n"
     "  components are x y z w, r g b a or s t p q, not mixed"},
    {"component_beyond",
     "float density(vec3 p) {\n"
     "    return p.xy.z;\n"
     "}\n",
     "world.karst:2:17: error: a vec2 has no component 'z'\n"
     "      return p.xy.z;\n"
     "                  ^\n"
     "  it has xy"},
    {"swizzle_twice",
     "float density(vec3 p) {\n"
     "    p.xx = vec2(1.0);\n"
     "    return p.x;\n"
     "}\n",
     "world.karst:2:7: error: '.xx' names a component twice and cannot be assigned to\n"
     "      p.xx = vec2(1.0);\n"
     "        ^"},
    {"no_density_map", "float map(vec3 p) { return length(p) - 1.0; }\n",
     "world.karst:1:7: error: there is no function 'density', but 'map' looks like a distance\n"
     "  float map(vec3 p) { return length(p) - 1.0; }\n"
     "        ^\n"
     "  add the line: float density(vec3 p) { return -map(p); }"},
    {"no_density_vec2_map", "vec2 map(vec3 p) { return vec2(length(p), 1.0); }\n",
     "world.karst:1:6: error: there is no function 'density', but 'map' looks like a distance\n"
     "  vec2 map(vec3 p) { return vec2(length(p), 1.0); }\n"
     "       ^\n"
     "  add the line: float density(vec3 p) { return -map(p).x; }"},
    {"no_density", "float other(float x) { return x; }\n",
     "world.karst:2:1: error: there is no function 'density'\n"
     "  write float density(vec3 p) { return -p.y; }"},
    {"density_misspelt", "float densty(vec3 p) { return 0.0; }\n",
     "world.karst:1:7: error: there is no function 'density', but a 'densty'\n"
     "  float densty(vec3 p) { return 0.0; }\n"
     "        ^\n"
     "  is this it? Then call it density"},
    {"density_signature", "float density(vec2 p) { return 0.0; }\n",
     "world.karst:1:7: error: 'density' has other parameters or another result here\n"
     "  float density(vec2 p) { return 0.0; }\n"
     "        ^\n"
     "  write float density(vec3 p)"},
    {"while_loop",
     "float density(vec3 p) {\n"
     "    while (p.x > 1.0) p.x -= 1.0;\n"
     "    return p.x;\n"
     "}\n",
     "world.karst:2:5: error: nothing bounds this loop\n"
     "      while (p.x > 1.0) p.x -= 1.0;\n"
     "      ^\n"
     "  add a counter: for (int i = 0; i < 100 && CONDITION; i++)"},
    {"do_loop",
     "float density(vec3 p) {\n"
     "    do { p.x -= 1.0; } while (p.x > 1.0);\n"
     "    return p.x;\n"
     "}\n",
     "world.karst:2:5: error: nothing bounds this loop\n"
     "      do { p.x -= 1.0; } while (p.x > 1.0);\n"
     "      ^\n"
     "  add a counter: for (int i = 0; i < 100 && CONDITION; i++)"},
    {"switch_of_a_float",
     "float density(vec3 p) {\n"
     "    switch (p.x) { case 0: return 1.0; }\n"
     "    return 0.0;\n"
     "}\n",
     "world.karst:2:15: error: 'switch' looks at an int, not a float\n"
     "      switch (p.x) { case 0: return 1.0; }\n"
     "                ^\n"
     "  write switch (int(...))"},
    {"switch_with_a_label_twice",
     "float density(vec3 p) {\n"
     "    switch (int(p.x)) { case 1: case 2: case 1: return 1.0; }\n"
     "    return 0.0;\n"
     "}\n",
     "world.karst:2:41: error: this 'switch' has that label twice\n"
     "      switch (int(p.x)) { case 1: case 2: case 1: return 1.0; }\n"
     "                                          ^\n"
     "  leave one of them"},
    {"switch_with_a_label_that_varies",
     "float density(vec3 p) {\n"
     "    switch (1) { case int(p.x): return 1.0; }\n"
     "    return 0.0;\n"
     "}\n",
     "world.karst:2:23: error: a label of 'switch' must not depend on the position\n"
     "      switch (1) { case int(p.x): return 1.0; }\n"
     "                        ^\n"
     "  use a number, a const or a parameter"},
    {"switch_without_a_label",
     "float density(vec3 p) {\n"
     "    switch (int(p.x)) { return 1.0; }\n"
     "    return 0.0;\n"
     "}\n",
     "world.karst:2:25: error: expected a label in 'switch', not 'return'\n"
     "      switch (int(p.x)) { return 1.0; }\n"
     "                          ^\n"
     "  write case 0: or default: before it"},
    {"label_without_a_switch",
     "float density(vec3 p) {\n"
     "    default: return 0.0;\n"
     "}\n",
     "world.karst:2:5: error: there is no 'switch' around this label\n"
     "      default: return 0.0;\n"
     "      ^\n"
     "  labels stand directly in the braces of 'switch'"},
    {"continue_in_a_switch_alone",
     "float density(vec3 p) {\n"
     "    switch (int(p.x)) { case 0: continue; }\n"
     "    return 0.0;\n"
     "}\n",
     "world.karst:2:33: error: there is no loop around this 'continue'\n"
     "      switch (int(p.x)) { case 0: continue; }\n"
     "                                  ^"},
    {"length_of_a_float",
     "float density(vec3 p) {\n"
     "    return float(p.x.length());\n"
     "}\n",
     "world.karst:2:22: error: a float has no length(): only arrays, vectors and matrices have\n"
     "      return float(p.x.length());\n"
     "                       ^"},
    {"endless_loop",
     "float density(vec3 p) {\n"
     "    for (float t = 0.0; t < p.x; t += 1.0) p.y += 1.0;\n"
     "    return p.y;\n"
     "}\n",
     "world.karst:2:5: error: nothing bounds this loop\n"
     "      for (float t = 0.0; t < p.x; t += 1.0) p.y += 1.0;\n"
     "      ^\n"
     "  add a counter: for (int i = 0; i < 100 && CONDITION; i++)"},
    {"loop_of_a_billion",
     "float density(vec3 p) {\n"
     "    for (int i = 0; i < 1000000000; i++) p.y += 1.0;\n"
     "    return p.y;\n"
     "}\n",
     "world.karst:2:5: error: this loop runs more than 16384 times\n"
     "      for (int i = 0; i < 1000000000; i++) p.y += 1.0;\n"
     "      ^\n"
     "  make it shorter"},
    {"recursion",
     "float f(float x) { return x > 0.0 ? f(x - 1.0) : 0.0; }\n"
     "float density(vec3 p) { return f(p.x); }\n",
     "world.karst:1:37: error: 'f' calls itself: there is no recursion\n"
     "  float f(float x) { return x > 0.0 ? f(x - 1.0) : 0.0; }\n"
     "                                      ^\n"
     "  write a loop with a bound"},
    {"texture",
     "uniform sampler2D tex;\n"
     "float density(vec3 p) {\n"
     "    return texture(tex, p.xz).x;\n"
     "}\n",
     "world.karst:3:12: error: a world has no screen and no textures, so there is no 'texture'\n"
     "      return texture(tex, p.xz).x;\n"
     "             ^\n"
     "  use noise(p), or name a file in the header's \"data\""},
    {"derivative",
     "float density(vec3 p) {\n"
     "    return dFdx(p.x);\n"
     "}\n",
     "world.karst:2:12: error: a world has no screen and no textures, so there is no 'dFdx'\n"
     "      return dFdx(p.x);\n"
     "             ^\n"
     "  compute a difference of two calls"},
    {"include",
     "#include \"noise.glsl\"\n"
     "float density(vec3 p) { return -p.y; }\n",
     "world.karst:1:1: warning: a world is one file: #include is passed over\n"
     "  #include \"noise.glsl\"\n"
     "  ^\n"
     "  paste the text of that file here"},
    {"quoting",
     "#define NAME(a) #a\n"
     "float density(vec3 p) { return -p.y; }\n",
     "world.karst:1:17: error: macros cannot quote words\n"
     "  #define NAME(a) #a\n"
     "                  ^\n"
     "  there are no texts in a world"},
    {"pasting_to_nothing",
     "#define JOIN(a, b) a ##\n"
     "float density(vec3 p) { return -p.y; }\n",
     "world.karst:1:22: error: '##' stands between two words\n"
     "  #define JOIN(a, b) a ##\n"
     "                       ^\n"
     "  write a ## b"},
    {"pasting_numbers",
     "#define JOIN(a, b) a ## b\n"
     "float density(vec3 p) { return JOIN(1, 2); }\n",
     "world.karst:2:32: error: '##' can make names only\n"
     "  float density(vec3 p) { return JOIN(1, 2); }\n"
     "                                 ^\n"
     "  paste names, and digits behind them"},
    {"unterminated_if",
     "#if 1\n"
     "float density(vec3 p) { return -p.y; }\n",
     "world.karst:1:1: error: this condition never ends\n"
     "  #if 1\n"
     "  ^\n"
     "  close it with #endif"},
    {"unterminated_comment",
     "float density(vec3 p) { return -p.y; }\n"
     "/* and then\n",
     "world.karst:2:1: error: this comment never ends\n"
     "  /* and then\n"
     "  ^\n"
     "  close it with */"},
    {"macro_arguments",
     "#define SQ(x) ((x) * (x))\n"
     "float density(vec3 p) {\n"
     "    return SQ(p.x, 2.0);\n"
     "}\n",
     "world.karst:3:12: error: macro 'SQ' takes 1 argument, not more\n"
     "      return SQ(p.x, 2.0);\n"
     "             ^"},
    {"in_a_macro",
     "#define HEIGHT(q) hieght(q)\n"
     "float height(vec3 q) { return q.y; }\n"
     "float density(vec3 p) {\n"
     "    return HEIGHT(p);\n"
     "}\n",
     "world.karst:4:12: error: there is no function 'hieght'\n"
     "      return HEIGHT(p);\n"
     "             ^\n"
     "  did you mean 'height'?"},
    {"no_overload",
     "float f(vec2 a) { return a.x; }\n"
     "float f(vec3 a, float b) { return b; }\n"
     "float density(vec3 p) {\n"
     "    return f(p);\n"
     "}\n",
     "world.karst:4:12: error: no function 'f' takes (vec3)\n"
     "      return f(p);\n"
     "             ^\n"
     "  there is f(vec2), f(vec3, float)"},
    {"builtin_arguments",
     "float density(vec3 p) {\n"
     "    return dot(p, p.xy);\n"
     "}\n",
     "world.karst:2:12: error: no function 'dot' takes (vec3, vec2)\n"
     "      return dot(p, p.xy);\n"
     "             ^\n"
     "  write dot(v, w) with two vectors of a kind"},
    {"assign_to_parameter",
     "/*{ \"params\": { \"relief\": 4 } }*/\n"
     "float density(vec3 p) {\n"
     "    relief = 2.0;\n"
     "    return relief;\n"
     "}\n",
     "world.karst:3:5: error: 'relief' is a parameter and cannot be assigned to\n"
     "      relief = 2.0;\n"
     "      ^\n"
     "  copy it to a variable first"},
    {"assign_to_const",
     "const float k = 2.0;\n"
     "float density(vec3 p) {\n"
     "    k = 3.0;\n"
     "    return k;\n"
     "}\n",
     "world.karst:3:5: error: 'k' is const and cannot be assigned to\n"
     "      k = 3.0;\n"
     "      ^\n"
     "  leave out 'const' where it is declared"},
    {"index_outside",
     "float density(vec3 p) {\n"
     "    float a[3] = float[3](1.0, 2.0, 3.0);\n"
     "    return a[3];\n"
     "}\n",
     "world.karst:3:14: error: the index 3 is outside this float[3], which has elements 0 to 2\n"
     "      return a[3];\n"
     "               ^"},
    {"varying_octaves",
     "float density(vec3 p) {\n"
     "    return fbm(p, int(p.x));\n"
     "}\n",
     "world.karst:2:12: error: the number of octaves must not depend on the position\n"
     "      return fbm(p, int(p.x));\n"
     "             ^\n"
     "  use a number, a const or a parameter"},
    {"condition_no_bool",
     "float density(vec3 p) {\n"
     "    if (p.x) return 1.0;\n"
     "    return 0.0;\n"
     "}\n",
     "world.karst:2:11: error: the condition of 'if' is a bool, not a float\n"
     "      if (p.x) return 1.0;\n"
     "            ^\n"
     "  write x != 0"},
    {"missing_bracket",
     "float density(vec3 p) {\n"
     "    return (p.x + 1.0;\n"
     "}\n",
     "world.karst:2:22: error: expected ')' to close the bracket, not ';'\n"
     "      return (p.x + 1.0;\n"
     "                       ^"},
    {"unclosed_function",
     "float density(vec3 p) {\n"
     "    return p.x;\n",
     "world.karst:1:23: error: this '{' is never closed\n"
     "  float density(vec3 p) {\n"
     "                        ^\n"
     "  close it with }"},
    {"missing_return",
     "float density(vec3 p) {\n"
     "    p.x = 1.0;\n"
     "}\n",
     "world.karst:1:23: error: 'density' never returns a value\n"
     "  float density(vec3 p) {\n"
     "                        ^\n"
     "  end it with return"},
    {"return_nothing",
     "float density(vec3 p) {\n"
     "    return;\n"
     "}\n",
     "world.karst:2:5: error: 'density' must give a float\n"
     "      return;\n"
     "      ^\n"
     "  write return and a float"},
    {"break_outside",
     "float density(vec3 p) {\n"
     "    break;\n"
     "    return 0.0;\n"
     "}\n",
     "world.karst:2:5: error: there is no loop around this 'break'\n"
     "      break;\n"
     "      ^"},
    {"modulo_of_floats",
     "float density(vec3 p) {\n"
     "    return p.x % 2.0;\n"
     "}\n",
     "world.karst:2:16: error: '%' is for ints only\n"
     "      return p.x % 2.0;\n"
     "                 ^\n"
     "  write mod(a, b)"},
    {"too_many_components",
     "float density(vec3 p) {\n"
     "    vec3 q = vec3(p, 1.0);\n"
     "    return q.x;\n"
     "}\n",
     "world.karst:2:14: error: a vec3 has 3 components; (vec3, float) has more\n"
     "      vec3 q = vec3(p, 1.0);\n"
     "               ^\n"
     "  leave out what is too much"},
    {"too_few_components",
     "float density(vec3 p) {\n"
     "    vec3 q = vec3(1.0, 2.0);\n"
     "    return q.x;\n"
     "}\n",
     "world.karst:2:14: error: a vec3 has 3 components, not 2\n"
     "      vec3 q = vec3(1.0, 2.0);\n"
     "               ^"},
    {"struct_field",
     "struct Hit { float dist; int id; };\n"
     "float density(vec3 p) {\n"
     "    Hit h;\n"
     "    return h.dits;\n"
     "}\n",
     "world.karst:4:14: error: Hit has no field 'dits'\n"
     "      return h.dits;\n"
     "               ^\n"
     "  did you mean 'dist'?"},
    {"two_globals",
     "float a = 1.0;\n"
     "float a = 2.0;\n"
     "float density(vec3 p) { return -p.y; }\n",
     "world.karst:2:7: error: there are two globals called 'a'\n"
     "  float a = 2.0;\n"
     "        ^\n"
     "  rename one of them"},
    {"header_comma",
     "/*{ \"name\": \"x\" \"seed\": 1 }*/\n"
     "float density(vec3 p) { return -p.y; }\n",
     "world.karst:1:22: error: the header is not JSON: '}' expected near '\"seed\"'\n"
     "  /*{ \"name\": \"x\" \"seed\": 1 }*/\n"
     "                       ^\n"
     "  quote all names, put commas between, none at the end"},
    {"header_voxel",
     "/*{ \"voxel\": -1 }*/\n"
     "float density(vec3 p) { return -p.y; }\n",
     "world.karst:1:5: error: \"voxel\" is the width of the finest voxel in metres, from 2^-40 to 2^40\n"
     "  /*{ \"voxel\": -1 }*/\n"
     "      ^\n"
     "  write 0.0625"},
    {"header_unknown_key",
     "/*{ \"voxle\": 1, \"voxel\": 0.1 }*/\n"
     "float density(vec3 p) { return -p.y; }\n",
     "world.karst:1:5: warning: the header has no key \"voxle\"\n"
     "  /*{ \"voxle\": 1, \"voxel\": 0.1 }*/\n"
     "      ^\n"
     "  did you mean 'voxel'?\n"
     "world.karst:1:17: warning: \"voxel\" is rounded to a power of two: 0.125 m\n"
     "  /*{ \"voxle\": 1, \"voxel\": 0.1 }*/\n"
     "                  ^"},
    {"unused_parameter",
     "/*{ \"params\": { \"relief\": 4 } }*/\n"
     "float density(vec3 p) { return -p.y; }\n",
     "world.karst:1:17: warning: parameter 'relief' is not used\n"
     "  /*{ \"params\": { \"relief\": 4 } }*/\n"
     "                  ^"},
    {"unset_global",
     "float glow;\n"
     "float density(vec3 p) {\n"
     "    return glow - p.y;\n"
     "}\n",
     "world.karst:3:12: warning: 'glow' is read but not set: it is 0\n"
     "      return glow - p.y;\n"
     "             ^\n"
     "  give it a value, or remove it and write \"params\": { \"glow\": 1 } into the header"},
    {"colour_misspelt",
     "float density(vec3 p) { return -p.y; }\n"
     "vec3 coluor(vec3 p, vec3 n) { return n; }\n",
     "world.karst:2:6: warning: there is no function 'colour', but a 'coluor'\n"
     "  vec3 coluor(vec3 p, vec3 n) { return n; }\n"
     "       ^\n"
     "  is this it? Then call it colour"},
    {"colour_of_another_kind",
     "float density(vec3 p) { return -p.y; }\n"
     "vec3 colour(float t) { return vec3(t); }\n",
     "world.karst:2:6: warning: 'colour' is not used: it has other parameters or another result than Karst's own\n"
     "  vec3 colour(float t) { return vec3(t); }\n"
     "       ^\n"
     "  write vec3 colour(vec3 p, vec3 n)"},
    {"surface_of_another_kind",
     "float density(vec3 p) { return -p.y; }\n"
     "vec3 surface(vec3 p, vec3 n) { return n; }\n",
     "world.karst:2:6: warning: 'surface' is not used: it has other parameters or another result than Karst's own\n"
     "  vec3 surface(vec3 p, vec3 n) { return n; }\n"
     "       ^\n"
     "  write material surface(vec3 p, vec3 n)"},
    {"surface_misspelt",
     "float density(vec3 p) { return -p.y; }\n"
     "material surfcae(vec3 p, vec3 n) { material m; return m; }\n",
     "world.karst:2:10: warning: there is no function 'surface', but a 'surfcae'\n"
     "  material surfcae(vec3 p, vec3 n) { material m; return m; }\n"
     "           ^\n"
     "  is this it? Then call it surface"},
    {"colour_besides_surface",
     "float density(vec3 p) { return -p.y; }\n"
     "vec3 color(vec3 p, vec3 n) { return n; }\n"
     "material surface(vec3 p, vec3 n) { material m; return m; }\n",
     "world.karst:2:6: warning: 'color' is not used: 'surface' gives what it would\n"
     "  vec3 color(vec3 p, vec3 n) { return n; }\n"
     "       ^\n"
     "  call it in surface, or remove it"},
    {"place_on_the_screen",
     "float density(vec3 p) {\n"
     "    return gl_FragCoord.x - p.y;\n"
     "}\n",
     "world.karst:2:12: error: a world has no screen and no vertices, so there is no 'gl_FragCoord'\n"
     "      return gl_FragCoord.x - p.y;\n"
     "             ^\n"
     "  compute it from p, the place that is asked for"},
    {"assignment_for_comparison",
     "float density(vec3 p) {\n"
     "    if (p.x = 1.0) return 1.0;\n"
     "    return -p.y;\n"
     "}\n",
     "world.karst:2:13: error: the condition of 'if' is a bool, not a float\n"
     "      if (p.x = 1.0) return 1.0;\n"
     "              ^\n"
     "  = assigns: write == to compare"},
    {"order_of_vectors",
     "float density(vec3 p) {\n"
     "    return p > vec3(0.0) ? 1.0 : -p.y;\n"
     "}\n",
     "world.karst:2:14: error: '>' does not go between vec3 and vec3\n"
     "      return p > vec3(0.0) ? 1.0 : -p.y;\n"
     "               ^\n"
     "  compare components, or use lessThan(a, b) and the like with all(...) or any(...)"},
    {"bad_number",
     "float density(vec3 p) {\n"
     "    return 1.0x;\n"
     "}\n",
     "world.karst:2:12: error: this number goes on with 'x', which is none of its digits\n"
     "      return 1.0x;\n"
     "             ^"},
    {"odd_character",
     "float density(vec3 p) {\n"
     "    return p.x @ 2.0;\n"
     "}\n",
     "world.karst:2:16: error: the character '@' has no meaning here\n"
     "      return p.x @ 2.0;\n"
     "                 ^"},
    {"not_ascii",
     "float density(vec3 p) {\n"
     "    float höhe = 1.0;\n"
     "    return höhe;\n"
     "}\n",
     "world.karst:2:12: error: letters beyond ASCII may stand in comments only\n"
     "      float höhe = 1.0;\n"
     "             ^\n"
     "  names are made of a-z, A-Z, 0-9 and _"},
    {"discard",
     "float density(vec3 p) {\n"
     "    discard;\n"
     "    return 0.0;\n"
     "}\n",
     "world.karst:2:5: error: there is no 'discard': a density has no pixel to drop\n"
     "      discard;\n"
     "      ^\n"
     "  return a negative density: that is air"},
    {"two_distances",
     "float density(vec3 p) {\n"
     "    return worley(p);\n"
     "}\n",
     "world.karst:2:12: error: the result needs a float, not a vec2\n"
     "      return worley(p);\n"
     "             ^\n"
     "  take a part of it, such as .x"},
    {"empty", "   \n",
     "world.karst:1:1: error: the file is empty\n"
     "  a world needs a function `float density(vec3 p)`"},
    {"call_a_variable",
     "float density(vec3 p) {\n"
     "    return p(1.0);\n"
     "}\n",
     "world.karst:2:12: error: 'p' is a variable, not a function\n"
     "      return p(1.0);\n"
     "             ^"},
    {"function_as_value",
     "float height(vec3 q) { return q.y; }\n"
     "float density(vec3 p) {\n"
     "    return height - p.y;\n"
     "}\n",
     "world.karst:3:12: error: there is no variable 'height'\n"
     "      return height - p.y;\n"
     "             ^\n"
     "  it is a function: write height(...)"},
    {"variable_twice",
     "float density(vec3 p) {\n"
     "    float a = p.x;\n"
     "    float a = p.y;\n"
     "    return a;\n"
     "}\n",
     "world.karst:3:11: error: there is a variable 'a' here already\n"
     "      float a = p.y;\n"
     "            ^\n"
     "  rename one of them, or assign without a type"},
    {"density_twice",
     "float density(vec3 p) { return p.x; }\n"
     "float density(vec3 p) { return p.y; }\n",
     "world.karst:2:7: error: there are two functions 'density' with a body\n"
     "  float density(vec3 p) { return p.y; }\n"
     "        ^\n"
     "  rename one of them"},
    {"struct_beyond_its_block",
     "float density(vec3 p) {\n"
     "    { struct Marble { float r; }; }\n"
     "    Marble b;\n"
     "    return b.r;\n"
     "}\n",
     "world.karst:3:5: error: there is no type 'Marble'\n"
     "      Marble b;\n"
     "      ^"},
    {"struct_twice_in_a_block",
     "float density(vec3 p) {\n"
     "    struct S { float r; };\n"
     "    struct S { float q; };\n"
     "    return 0.0;\n"
     "}\n",
     "world.karst:3:12: error: there are two structs called 'S'\n"
     "      struct S { float q; };\n"
     "             ^\n"
     "  rename one of them"},
    {"arrays_of_arrays",
     "float density(vec3 p) {\n"
     "    float a[2][3];\n"
     "    return a[0][3];\n"
     "}\n",
     "world.karst:3:17: error: the index 3 is outside this float[3], which has elements 0 to 2\n"
     "      return a[0][3];\n"
     "                  ^"},
    {"camera_beyond",
     "/*{ \"camera\": { \"position\": [\"1e99\", \"0\", \"0\"] } }*/\n"
     "float density(vec3 p) { return -p.y; }\n",
     "world.karst:1:17: error: \"position\" is three decimals, in metres: \"1e99\" lies beyond the world's edge: with "
     "voxels of 2^-4 m it reaches 2.882e+17 m\n"
     "  /*{ \"camera\": { \"position\": [\"1e99\", \"0\", \"0\"] } }*/\n"
     "                  ^\n"
     "  write [\"0\", \"320\", \"0\"]"},
    {"view_too_far",
     "/*{ \"view\": 1e99 }*/\n"
     "float density(vec3 p) { return -p.y; }\n",
     "world.karst:1:5: error: \"view\" is a number from 1 to 4.5036e+15\n"
     "  /*{ \"view\": 1e99 }*/\n"
     "      ^"},
};

#endif
