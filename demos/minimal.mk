# Builds minimal.c, or mesh.c, against an installed libkarst, wherever pkg-config finds it.
minimal: minimal.c
	$(CC) -std=c11 -O2 $(CFLAGS) $(shell pkg-config --cflags karst) $< $(LDFLAGS) $(shell pkg-config --libs karst) -o $@
mesh: mesh.c
	$(CC) -std=c11 -O2 $(CFLAGS) $(shell pkg-config --cflags karst osmesa) $< $(LDFLAGS) $(shell pkg-config --libs karst osmesa) -lm -o $@
