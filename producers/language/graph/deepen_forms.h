/* Forms whose air is exactly 0 beyond those that deepen.c sees by itself: written anew, with the same sign everywhere,
 * so that it does. */
#ifndef KARST_LANGUAGE_DEEPEN_FORMS_H
#define KARST_LANGUAGE_DEEPEN_FORMS_H

#include "producers/language/graph/kinds.h"

/* The density in such words; `density` itself where there are no such forms. As karst_deepen otherwise. */
karst_expr karst_deepen_forms(karst_graph *graph, const karst_kinds_settings *settings, karst_expr density);

#endif
