/* What a driver's compiler says of a text that does not build. */
#ifndef KARST_CORE_BUILD_LOG_H
#define KARST_CORE_BUILD_LOG_H

/* The log with the places that its reader knows, malloc'ed; NULL if there is no memory. Some compilers (NVIDIA's) do
 * not read #line and count the lines of the whole expanded text: "<kernel>:588:16: error". Such places become the file
 * and line that the #line directives of `source` name. Everything else stays. */
char *karst_build_log_with_places(const char *log, const char *source);

#endif
