// What surrounds the figures: the background and the ground grid.

class Stage {
  constructor(gl, programs, header) {
    Object.assign(this, { gl, programs, header });
    this.corners = bufferOf(gl, Float32Array.of(-1, -1, 1, -1, -1, 1, 1, 1));
    this.none = gl.createVertexArray();
  }

  drawBackground() {
    const gl = this.gl, program = this.programs.get("background");
    gl.disable(gl.DEPTH_TEST);
    setUniforms(gl, program, this.header.background);
    gl.bindVertexArray(this.none);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.enable(gl.DEPTH_TEST);
  }

  drawGrid(camera) {
    const gl = this.gl, program = this.programs.get("ground"), { ground } = this.header;
    this.array ??= vertexArray(gl, program, { in_corner: [this.corners, 2] });
    setUniforms(gl, program, { ...ground.uniforms, u_projection: camera.projection,
      u_model_view: product4(camera.view, ground.placement) });
    gl.bindVertexArray(this.array);
    // The translucent grid must not hide what is drawn later.
    gl.depthMask(false);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    gl.depthMask(true);
    gl.bindVertexArray(null);
  }
}
