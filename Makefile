# Karst. `make help` lists the targets; V=1 shows commands; CONFIG=release|debug|asan chooses flags.
VERSION   := 0.1.0
SOVERSION := 0
CONFIG  ?= release
BUILD   ?= build
OBJ     := $(BUILD)/$(CONFIG)
# Products of the release stand at the top of the build folder, those of other configurations beside their objects.
OUT     := $(if $(filter release,$(CONFIG)),$(BUILD),$(OBJ))
PREFIX  ?= /usr/local
# Where the library goes below PREFIX.
LIBDIR  ?= lib
DESTDIR ?=
CC      ?= cc
AR      ?= ar
# A text as one word of the shell's, whatever is in it.
quoted = '$(subst ','\'',$(1))'
# Folders that make the library, lowest floor first. Fewer may be named to build a part while working on it.
ALL_MODULES := core noise producers cache raycast reference
MODULES ?= $(ALL_MODULES)
PARTIAL := $(filter-out $(MODULES),$(ALL_MODULES))
V ?= 0
ifeq ($(V),1)
Q :=
say = @:
else
Q := @
say = @printf '  %-6s %s\n'
endif

WARN   := -Wall -Wextra -Werror=switch -Wstrict-prototypes -Wmissing-prototypes -Wshadow -Wpointer-arith -Wwrite-strings -Wvla
PKGS   := libpng libtiff-4 jansson sqlite3 zlib
# What the command needs beyond the library's.
COMMAND_PKGS := cairo glfw3
CFLAGS_release := -O2 -g
CFLAGS_debug   := -O0 -g
CFLAGS_tsan    := -O1 -g -fsanitize=thread -fno-omit-frame-pointer
LDFLAGS_tsan   := -fsanitize=thread
CFLAGS_asan    := -O1 -g -fsanitize=address,undefined -fno-sanitize-recover=undefined -fno-omit-frame-pointer
LDFLAGS_asan   := -fsanitize=address,undefined
# make fuzz uses it, with clang.
CFLAGS_fuzz    := -g -O1 -fsanitize=fuzzer-no-link,address,undefined -fno-sanitize-recover=undefined
LDFLAGS_fuzz   := -fsanitize=fuzzer,address,undefined
ifeq ($(origin CFLAGS_$(CONFIG)),undefined)
$(error CONFIG=$(CONFIG): choose release, debug, asan, tsan or fuzz)
endif
# -ffp-contract=off: host and device must agree bit for bit.
KCFLAGS := -std=c11 -D_GNU_SOURCE -DKARST_VERSION='"$(VERSION)"' -ffp-contract=off -fPIC -pthread $(WARN) \
           $(CFLAGS_$(CONFIG)) -I. -Icore/include $(shell pkg-config --cflags $(PKGS) $(COMMAND_PKGS) 2>/dev/null) $(CFLAGS)
KLDFLAGS := $(LDFLAGS_$(CONFIG)) $(LDFLAGS)
KLIBS := $(shell pkg-config --libs $(PKGS) 2>/dev/null) -lOpenEXRCore -lOpenCL -ldl -lm -pthread
COMMAND_LIBS := $(shell pkg-config --libs $(COMMAND_PKGS) 2>/dev/null)

SOURCES := $(sort $(shell find $(MODULES) -name '*.c'))
OBJECTS := $(SOURCES:%.c=$(OBJ)/%.o) $(OBJ)/embedded_kernels.o
# Everything that a kernel may include travels inside the library.
KERNELS := $(sort $(shell find $(MODULES) -name '*.cl' -o -name '*.clh' -o -name '*_shared.h' -o -name '*.karst') core/device/dialect.h)
HEADERS := $(sort $(wildcard core/include/karst/*.h))
COMMAND_OBJECTS := $(patsubst %.c,$(OBJ)/%.o,demos/command/karst.c demos/command/plot.c \
    $(sort $(wildcard demos/command/command_*.c demos/view/*.c)))
WORLDS  := $(sort $(wildcard demos/worlds/*.karst))
WORLD_DATA := $(sort $(wildcard demos/worlds/data/*.png demos/worlds/data/*.karstpoints))
PATHS   := $(sort $(wildcard demos/paths/*.json))

# A test or benchmark is one file with a main(); what several of them share stands in tests/support/.
TEST_FOLDERS := $(if $(PARTIAL),$(wildcard $(MODULES:%=tests/%)),$(wildcard tests))
find_tests    = $(if $(TEST_FOLDERS),$(sort $(shell find $(TEST_FOLDERS) -name '$(1)_*.c')))
TESTS        := $(call find_tests,test)
BENCHES      := $(call find_tests,bench)
TEST_SCRIPTS := $(addprefix tests/,run_selftest.sh lint/selftest.sh abi/run.sh api/run.sh cli/run.sh cli/bench.sh cli/world.sh cli/edits.sh cli/points.sh cli/saved.sh \
    cli/mesh.sh cli/heights.sh cli/voxels.sh cli/surface_points.sh cli/bake.sh \
    cli/accuracy.sh cli/environment.sh cli/command.sh cli/farm.sh cli/bands.sh cli/cold.sh cli/tutorial.sh packages/dependencies.sh $(if $(filter release,$(CONFIG)),oclgrind/run.sh))
SUPPORT_OBJECTS := $(patsubst %.c,$(OBJ)/%.o,$(sort $(wildcard tests/support/*.c)))
SUPPORT := $(OBJ)/tests/libsupport.a
TEST_PROGRAMS  := $(TESTS:%.c=$(OBJ)/%)
BENCH_PROGRAMS := $(BENCHES:%.c=$(OBJ)/%)

LIBRARY := $(OUT)/libkarst.a
SHARED  := $(OUT)/libkarst.so.$(SOVERSION)
COMMAND := $(OUT)/karst

.DEFAULT_GOAL := all
ifeq ($(PARTIAL),)
all: $(LIBRARY) $(COMMAND) $(if $(filter release,$(CONFIG)),$(OUT)/libkarst.so)
else
all: $(LIBRARY)
endif

# ---- what must be installed first ----
# A stamp that make itself includes: when it is made anew, make starts over and finds what was installed.
# `make demo` and `make check` may install packages; every other target only says what is missing.
GOALS := $(or $(MAKECMDGOALS),all)
ifneq ($(filter-out clean help uninstall lint abi,$(GOALS)),)
ifneq ($(words $(BUILD)),1)
$(error BUILD=$(BUILD): make cannot use a folder whose name holds a blank; choose another)
endif
ifneq ($(shell mkdir -p $(call quoted,$(BUILD)) 2> /dev/null && [ -w $(call quoted,$(BUILD)) ] && echo yes),yes)
$(error $(abspath $(BUILD)) cannot be written: build in another folder, as in make BUILD=/tmp/karst-build)
endif
endif
ifneq ($(filter-out clean help uninstall abi,$(GOALS)),)
NEED := $(if $(filter-out all demo install $(LIBRARY) $(COMMAND),$(GOALS)),tests,build)
$(BUILD)/dependencies-$(NEED).mk: .ci/install-dependencies
	@sh .ci/install-dependencies $(if $(filter demo check,$(GOALS)),,--check) $(NEED)
	@mkdir -p $(@D) && touch $@
include $(BUILD)/dependencies-$(NEED).mk
endif

# ---- compiling ----
# Files that change only when their text does: flags and lists of files. A change of either rebuilds what it touches.
define remember
	@mkdir -p $(@D)
	@printf '%s\n' '$(subst ','\'',$(1))' | cmp -s - $@ || printf '%s\n' '$(subst ','\'',$(1))' > $@
endef
$(OBJ)/flags: FORCE
	$(call remember,$(CC) $(KCFLAGS) | $(AR) $(KLDFLAGS) $(KLIBS))
$(OBJ)/prefix: FORCE
	$(call remember,$(PREFIX))
$(OBJ)/kernels: FORCE
	$(call remember,$(KERNELS))
$(OBJ)/objects: FORCE
	$(call remember,$(OBJECTS) $(COMMAND_OBJECTS) $(SUPPORT_OBJECTS))

$(OBJ)/%.o: %.c $(OBJ)/flags
	$(say) CC $<
	$(Q)mkdir -p $(@D) && $(CC) $(KCFLAGS) $(EXTRA) -MMD -MP -c $< -o $@
# `karst --version` and karst_info name them.
$(OBJ)/demos/command/command_info.o $(OBJ)/core/display/info.o: EXTRA = -DKARST_BUILD_FLAGS='"$(CONFIG): $(strip $(CFLAGS_$(CONFIG)) $(CFLAGS))"'

# Kernels that the host compiles for itself find their world there.
$(OBJ)/producers/density/host_steps.o: EXTRA = -Iproducers/density/host
# Loops that become vectors, whatever else is not optimised; no value depends on what these leave out.
$(OBJ)/producers/density/host_tape.o: EXTRA = -O2 -ftree-vectorize -fno-trapping-math -fno-math-errno \
    $(if $(findstring clang,$(CC)),,-fvect-cost-model=dynamic)
$(addprefix $(OBJ)/core/points/,near.o turn.o): EXTRA = -ftree-vectorize -fno-trapping-math -fno-math-errno

# What meshes are made of: short loops over axes, which are worth unrolling.
ifeq ($(CONFIG),release)
$(addprefix $(OBJ)/core/export/,crossing.o feature.o join.o piece.o piece_place.o piece_sample.o piece_segments.o): EXTRA = -O3
endif

# Where installed worlds lie, for programs that are linked statically.
$(OBJ)/core/base/data_folder.o: EXTRA = -DKARST_PREFIX='"$(PREFIX)"'
$(OBJ)/core/base/data_folder.o: $(OBJ)/prefix

$(OBJ)/embedded_kernels.c: core/device/embed.sh $(OBJ)/kernels $(KERNELS)
	$(say) EMBED $@
	$(Q)mkdir -p $(@D) && sh core/device/embed.sh $(KERNELS) > $@.tmp && mv $@.tmp $@
$(OBJ)/embedded_kernels.o: $(OBJ)/embedded_kernels.c $(OBJ)/flags
	$(say) CC $<
	$(Q)$(CC) $(KCFLAGS) -c $< -o $@

# ---- linking ----
$(LIBRARY): $(OBJECTS) $(OBJ)/objects
	$(say) AR $@
	$(Q)rm -f $@ && $(AR) rcs $@ $(OBJECTS)

# Only what the public headers declare leaves the shared library.
$(OBJ)/exports: core/package/exports.sh core/package/symbols $(HEADERS)
	@mkdir -p $(@D)
	@sh core/package/exports.sh core/package/symbols $(HEADERS) > $@.tmp && mv $@.tmp $@
$(SHARED): $(OBJECTS) $(OBJ)/objects $(OBJ)/exports
	$(say) LD $@
	$(Q)$(CC) -shared -Wl,-soname,$(@F) -Wl,--version-script=$(OBJ)/exports -Wl,--no-undefined -Wl,--as-needed \
	    $(KLDFLAGS) $(OBJECTS) $(KLIBS) -o $@
$(OUT)/libkarst.so: $(SHARED)
	$(Q)ln -sf $(<F) $@

# What the command says of itself, as a manual page.
$(OUT)/karst.1: demos/desktop/manual.sh $(COMMAND)
	$(say) MAN $@
	$(Q)sh demos/desktop/manual.sh $(COMMAND) > $@.tmp && mv $@.tmp $@

# Built elsewhere, the command finds the worlds that come with it by a link.
elsewhere := $(if $(filter $(CURDIR)/%,$(abspath $(BUILD))),,yes)
$(COMMAND): $(COMMAND_OBJECTS) $(LIBRARY)
	$(say) LD $@
	$(if $(elsewhere),$(Q)mkdir -p $(BUILD)/share && ln -sfn $(call quoted,$(CURDIR)/demos) $(BUILD)/share/karst)
	$(Q)$(CC) $(KLDFLAGS) $(COMMAND_OBJECTS) $(LIBRARY) $(COMMAND_LIBS) $(KLIBS) -o $@

# An archive, so that a program takes only what it uses.
$(SUPPORT): $(SUPPORT_OBJECTS) $(OBJ)/objects
	$(Q)rm -f $@ && $(AR) rcs $@ $(SUPPORT_OBJECTS)
# It drops files on a window; the headers of OpenGL bring those of X.
$(OBJ)/tests/window/test_opening: TEST_LIBS := -lX11
# What tests/support/faults.c stands before.
FAULTS := malloc calloc realloc strdup clFinish clBuildProgram clCompileProgram clCreateBuffer clEnqueueNDRangeKernel clEnqueueReadBuffer \
    clEnqueueWriteBuffer clEnqueueFillBuffer clEnqueueMapBuffer sqlite3_step sqlite3_exec sqlite3_backup_step sqlite3_errcode \
    sqlite3_extended_errcode dlopen
$(OBJ)/tests/api/%: WRAP = $(FAULTS:%=-Wl,--wrap=%)
$(TEST_PROGRAMS): $(OBJ)/%: $(OBJ)/%.o $(SUPPORT) $(LIBRARY)
	$(say) LD $@
	$(Q)$(CC) $(KLDFLAGS) $(WRAP) $< $(SUPPORT) $(LIBRARY) -lcmocka $(TEST_LIBS) $(KLIBS) -o $@
$(BENCH_PROGRAMS): $(OBJ)/%: $(OBJ)/%.o $(SUPPORT) $(LIBRARY)
	$(say) LD $@
	$(Q)$(CC) $(KLDFLAGS) $< $(SUPPORT) $(LIBRARY) -lcmocka $(KLIBS) -o $@

# libFuzzer brings main.
FUZZERS := $(patsubst %.c,$(OBJ)/%,$(wildcard tests/fuzz/fuzz_*.c))
$(FUZZERS): %: %.o $(LIBRARY)
	$(say) LD $@
	$(Q)$(CC) $(KLDFLAGS) $< $(LIBRARY) $(KLIBS) -o $@

# ---- using ----
demo: $(COMMAND)
	$(Q)$(COMMAND) render hills -o $(BUILD)/demo.png

# ONLY=text runs those whose path holds the text, JOBS=1 one after the other. What takes longest comes first.
check: all $(TEST_PROGRAMS)
	$(Q)KARST=$(COMMAND) CONFIG=$(CONFIG) ONLY='$(ONLY)' STORE='$(abspath $(BUILD))/tests.store' sh tests/run.sh \
	    $(OBJ)/tests $(if $(PARTIAL),,$(TEST_SCRIPTS)) $(TEST_PROGRAMS)

# ONLY=text runs the programs that measure parts, whose path holds the text; PARTS="settled start" parts of the standard.
bench: all $(BENCH_PROGRAMS)
ifneq ($(ONLY),)
	$(Q)for program in $(foreach b,$(BENCH_PROGRAMS),$(if $(findstring $(ONLY),$(b)),$(b))); do $$program || exit; done
else
	$(Q)KARST=$(COMMAND) KARST_BENCH_PROGRAMS=$(OBJ)/tests sh tests/bench/standard.sh
endif

# FUZZ_SECONDS=n looks for longer. It begins with the worlds, what tests paste, and the hostile texts; what it finds to be
# new is kept beside them, and a finding as crash-* in the same folder.
FUZZ_SECONDS ?= 60
FUZZ_CORPUS = $(BUILD)/fuzz/corpus
HOSTILE = $(BUILD)/release/tests/language/test_hostile
fuzz:
	$(Q)$(MAKE) CONFIG=release $(HOSTILE)
	$(Q)$(MAKE) CONFIG=fuzz CC=clang $(BUILD)/fuzz/tests/fuzz/fuzz_language $(BUILD)/fuzz/tests/fuzz/fuzz_samples
	$(Q)mkdir -p $(FUZZ_CORPUS) && cp demos/worlds/*.karst tests/language/pasted/*.karst $(FUZZ_CORPUS) && \
	    $(HOSTILE) write $(FUZZ_CORPUS)
	$(Q)$(BUILD)/fuzz/tests/fuzz/fuzz_language -max_total_time=$(FUZZ_SECONDS) -timeout=30 -rss_limit_mb=2000 \
	    -max_len=8000 -print_final_stats=1 -artifact_prefix=$(BUILD)/fuzz/ $(FUZZ_CORPUS)
	$(Q)mkdir -p $(FUZZ_CORPUS)-samples && $(BUILD)/fuzz/tests/fuzz/fuzz_samples -max_total_time=$(FUZZ_SECONDS) -timeout=10 \
	    -rss_limit_mb=500 -malloc_limit_mb=2000 -max_len=6000 -artifact_prefix=$(BUILD)/fuzz/ $(FUZZ_CORPUS)-samples tests/fuzz/samples
	$(Q)$(MAKE) CONFIG=fuzz CC=clang $(BUILD)/fuzz/tests/fuzz/fuzz_points
	$(Q)mkdir -p $(FUZZ_CORPUS)-points
	$(Q)$(BUILD)/fuzz/tests/fuzz/fuzz_points -max_total_time=$(FUZZ_SECONDS) -timeout=2 -rss_limit_mb=500 \
	    -max_len=4000 -print_final_stats=1 -artifact_prefix=$(BUILD)/fuzz/points- $(FUZZ_CORPUS)-points tests/fuzz/points
	$(Q)$(MAKE) CONFIG=fuzz CC=clang $(BUILD)/fuzz/tests/fuzz/fuzz_volume
	$(Q)mkdir -p $(FUZZ_CORPUS)-volume
	$(Q)$(BUILD)/fuzz/tests/fuzz/fuzz_volume -max_total_time=$$(($(FUZZ_SECONDS) / 4)) -timeout=4 -rss_limit_mb=1000 \
	    -max_len=400 -artifact_prefix=$(BUILD)/fuzz/volume- $(FUZZ_CORPUS)-volume

# The pictures that the pages under docs/ and the README show.
docs-images: $(COMMAND) docs-view
	$(Q)mkdir -p docs/images/worlds
	$(Q)$(COMMAND) render demos/desktop/icon.karst -q -o demos/desktop/karst.png --size 256x256 --detail 0.5
	$(Q)$(COMMAND) render hills -q -o docs/images/hills.png --size 960x540
	$(Q)sh demos/desktop/scales.sh $(COMMAND) docs/images/scales.png
	$(Q)for world in $(notdir $(basename $(WORLDS))); do \
	    [ $$world = caustics ] && photons='--caustics 1000000' || photons=; \
	    $(COMMAND) render demos/worlds/$$world.karst -q -o docs/images/worlds/$$world.png --size 400x225 $$photons || exit; done
	$(Q)mkdir -p docs/images/gallery
	$(Q)sed -n 's/^    karst render \(.*\) -o \([a-z]*\.png\)$$/\1 -o docs\/images\/gallery\/\2/p' docs/GALLERY.md | \
	    while read -r options; do $(COMMAND) render $$options -q --size 400x225 || exit; done

# The tables and plots of docs/ACCURACY.md: minutes for each world; on a quiet machine.
ACCURACY_WORLDS := hills alps asteroid planet islands
docs-accuracy: $(COMMAND)
	$(Q)mkdir -p docs/accuracy
	$(Q)for world in $(ACCURACY_WORLDS); do \
	    $(COMMAND) accuracy $$world -q --size $(if $(SIZE),$(SIZE),320x240) --plot docs/accuracy/$$world.svg --csv docs/accuracy/$$world.csv > docs/accuracy/$$world.txt || exit; done

# The viewer's picture and clip, taken in a window (Xvfb, xdotool, ImageMagick, ffmpeg).
docs-view: $(COMMAND)
	$(Q)mkdir -p docs/images
	$(Q)sh demos/desktop/pictures.sh $(COMMAND) docs/images

lint:
	$(Q)CC='$(CC)' sh tests/lint/run.sh .

# ---- installing ----
# What lies below them is named by words of the shell's, as both may hold blanks and quotes.
root  = $(DESTDIR)$(PREFIX)
below = $(call quoted,$(root)/$(1))

define PKG_CONFIG_FILE
prefix=$(PREFIX)
includedir=$${prefix}/include
libdir=$${prefix}/$(LIBDIR)

Name: karst
Description: Ray-casts procedural landscapes from a density function
Version: $(VERSION)
Requires.private: $(PKGS)
Libs: -L"$${libdir}" -lkarst
Libs.private: -lOpenEXRCore -lOpenCL -ldl -lm -pthread
Cflags: -I"$${includedir}"
endef
export PKG_CONFIG_FILE

# Where the desktop and the shells look: FILE:FOLDER/NAME.
DESKTOP := $(OUT)/karst.1:man/man1/karst.1 demos/desktop/karst.desktop:applications/karst.desktop \
    demos/desktop/karst.png:icons/hicolor/256x256/apps/karst.png \
    demos/desktop/karst.bash:bash-completion/completions/karst demos/desktop/_karst:zsh/site-functions/_karst \
    demos/desktop/karst.fish:fish/vendor_completions.d/karst.fish
desktop_target = $(call below,share/$(lastword $(subst :, ,$(1))))

# From the CMake files up to the prefix, and the versions that fit one another.
up = $(shell echo '$(LIBDIR)/cmake/karst' | sed 's|[^/][^/]*|..|g')
series = $(shell echo '$(VERSION)' | sed 's/^\(0\.[0-9]*\).*/\1/; t; s/\..*//')
blank := $(subst ,, )
CMAKE_VALUES = s|@VERSION@|$(VERSION)|; s|@SOVERSION@|$(SOVERSION)|; s|@SERIES@|$(series)|; s|@UP@|$(up)|; s|@LIBS@|$(subst $(blank),;,$(strip $(KLIBS)))|

install: all $(OUT)/karst.1
	$(say) INSTALL $(call quoted,$(root))
	$(Q)install -d $(call below,bin) $(call below,include/karst) $(call below,$(LIBDIR)/pkgconfig) \
	    $(call below,$(LIBDIR)/cmake/karst)
	$(Q)install -m 755 $(COMMAND) $(call below,bin/karst)
	$(Q)install -m 644 $(HEADERS) $(call below,include/karst)
	$(Q)install -m 644 $(LIBRARY) $(SHARED) $(call below,$(LIBDIR))
	$(Q)ln -sf libkarst.so.$(SOVERSION) $(call below,$(LIBDIR)/libkarst.so)
	$(Q)printf '%s\n' "$$PKG_CONFIG_FILE" > $(call below,$(LIBDIR)/pkgconfig/karst.pc) && chmod 644 $(call below,$(LIBDIR)/pkgconfig/karst.pc)
	$(Q)for file in karst-config.cmake karst-config-version.cmake; do \
	    sed '$(CMAKE_VALUES)' core/package/$$file.in > $(call below,$(LIBDIR)/cmake/karst/)$$file && \
	    chmod 644 $(call below,$(LIBDIR)/cmake/karst/)$$file || exit; done
ifneq ($(WORLDS),)
	$(Q)install -d $(call below,share/karst/worlds) && install -m 644 $(WORLDS) $(call below,share/karst/worlds)
	$(Q)install -d $(call below,share/karst/worlds/data) && install -m 644 $(WORLD_DATA) $(call below,share/karst/worlds/data)
endif
	$(Q)install -d $(call below,share/karst/paths) && install -m 644 $(PATHS) $(call below,share/karst/paths)
	$(Q)$(foreach d,$(DESKTOP),install -D -m 644 $(firstword $(subst :, ,$(d))) $(call desktop_target,$(d)) &&) true

uninstall:
	$(say) REMOVE $(call quoted,$(root))
	$(Q)rm -f $(foreach f,bin/karst $(addprefix $(LIBDIR)/,libkarst.a libkarst.so libkarst.so.$(SOVERSION) pkgconfig/karst.pc \
	    cmake/karst/karst-config.cmake cmake/karst/karst-config-version.cmake) \
	    $(addprefix include/karst/,$(notdir $(HEADERS))) $(addprefix share/karst/worlds/,$(notdir $(WORLDS))) \
	    $(addprefix share/karst/worlds/data/,$(notdir $(WORLD_DATA))) \
	    $(addprefix share/karst/paths/,$(notdir $(PATHS))),$(call below,$(f))) \
	    $(foreach d,$(DESKTOP),$(call desktop_target,$(d)))
	$(Q)rmdir $(call below,include/karst) $(call below,$(LIBDIR)/cmake/karst) $(call below,share/karst/worlds/data) $(call below,share/karst/worlds) $(call below,share/karst/paths) \
	    $(call below,share/karst) 2>/dev/null || true

check-install: all
	$(Q)MAKE='$(MAKE)' CC='$(CC)' BUILD='$(BUILD)' CONFIG='$(CONFIG)' SCRATCH='$(abspath $(OBJ))/install-scratch' \
	    EXPORTS='$(OBJ)/exports' sh tests/run.sh $(OBJ)/tests tests/install/run.sh

# What the headers promise to be thread-safe, under ThreadSanitizer.
check-threads:
	$(Q)$(MAKE) CONFIG=tsan $(BUILD)/tsan/tests/core/test_threads
	$(Q)TSAN_OPTIONS=halt_on_error=1:second_deadlock_stack=1 sh tests/run.sh $(BUILD)/tsan/tests $(BUILD)/tsan/tests/core/test_threads

# The Python module, in a fresh environment: pip install . and its tests. PYTHON= names another interpreter.
check-python: all
	$(Q)KARST=$(COMMAND) LIBRARY='$(LIBRARY)' SHARED='$(SHARED)' CC='$(CC)' PYTHON='$(PYTHON)' \
	    SCRATCH='$(abspath $(OBJ))/python-scratch' sh tests/run.sh $(OBJ)/tests tests/python/run.sh

# What the public headers promise, written down anew: after additions, and before a release. docs/API.md says when.
abi:
	$(Q)sh tests/abi/dump.sh '$(CC)' > tests/abi/libkarst.abi.tmp && mv tests/abi/libkarst.abi.tmp tests/abi/libkarst.abi
	$(Q)sh tests/abi/symbols.sh $(series)

clean:
	rm -rf $(BUILD)

help:
	@echo 'make                 build $(BUILD)/karst, $(BUILD)/libkarst.a and $(BUILD)/libkarst.so'
	@echo 'make demo            render the world "hills" to $(BUILD)/demo.png (installs missing packages if it can)'
	@echo 'make check           build and run all tests (installs missing packages if it can); ONLY=text runs some'
	@echo 'make lint            check the layout, the includes and the style'
	@echo 'make bench           the standard benchmark; PARTS=start does a part, ONLY=cast measures a module'
	@echo 'make fuzz            fuzz the world language, files of samples, points, light and volumes with libFuzzer (clang); FUZZ_SECONDS=$(FUZZ_SECONDS)'
	@echo 'make docs-images     render the pictures of the README and docs/'
	@echo 'make docs-accuracy   measure the tables and plots of docs/ACCURACY.md'
	@echo 'make install         into PREFIX=$(PREFIX), below DESTDIR if given; make uninstall removes it'
	@echo 'make check-install   install into a scratch folder, build demos/minimal.c there, uninstall'
	@echo 'make abi             write down what the public headers promise (docs/API.md)'
	@echo 'make check-threads   what is promised to be thread-safe, under ThreadSanitizer'
	@echo 'make check-python    install the Python module into a fresh environment, run its tests'
	@echo 'make clean           remove $(BUILD)'
	@echo 'Only make demo and make check install packages (as root, or with sudo); every other target says which are missing.'
	@echo 'BUILD=/some/folder builds elsewhere than in build, as where this folder cannot be written'
	@echo 'CONFIG=release|debug|asan chooses flags, CFLAGS= and LDFLAGS= add to them, V=1 shows commands'
	@echo 'make CONFIG=asan check runs the tests under AddressSanitizer and UndefinedBehaviorSanitizer'

FORCE:
.PHONY: all demo check bench fuzz docs-images docs-accuracy docs-view lint install uninstall check-install check-python check-threads abi clean help FORCE
.SECONDARY:
.DELETE_ON_ERROR:
-include $(OBJECTS:.o=.d) $(COMMAND_OBJECTS:.o=.d) $(SUPPORT_OBJECTS:.o=.d) $(TEST_PROGRAMS:%=%.d) \
    $(BENCH_PROGRAMS:%=%.d)
