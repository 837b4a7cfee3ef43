/* What the 3D views of pages share: renderer, lights, a camera that looks at a sphere, colours of vertices. */

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

const FIELD = 24; // degrees of the camera's opening

export class Space {
  /** In a canvas that fills a stage; `draw` asks for a picture. */
  constructor(canvas, stage, draw) {
    Object.assign(this, { canvas, stage, draw });
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true });
    this.renderer.setPixelRatio(window.devicePixelRatio);
    this.scene = new THREE.Scene();
    this.scene.background = new THREE.Color(0xffffff);
    this.camera = new THREE.PerspectiveCamera(FIELD, 1, 1, 10000);
    this.addLights();
    new ResizeObserver(() => this.resize()).observe(stage);
    this.resize();
  }

  /** Three lights that move with the camera: key, fill, and from behind. */
  addLights() {
    const places = [[-0.6, 0.8, 1, 2.0], [1, 0.1, 0.8, 0.9], [0, 0.6, -1, 0.8]];
    for (const [x, y, z, strength] of places) {
      const light = new THREE.DirectionalLight(0xffffff, strength);
      light.position.set(x, y, z);
      this.camera.add(light, light.target);
    }
    this.scene.add(this.camera, new THREE.AmbientLight(0xffffff, 0.7));
  }

  /** Puts the camera on the side [x, y, z, and the direction upwards] of a sphere. */
  look([x, y, z, ...up], { center, radius }) {
    const half = Math.atan(Math.tan(THREE.MathUtils.degToRad(FIELD) / 2) * Math.min(this.camera.aspect, 1));
    this.camera.up.set(...up);
    this.camera.position.set(x, y, z).multiplyScalar(1.02 * radius / Math.sin(half)).add(center);
    this.camera.lookAt(center);
    this.camera.near = radius / 50;
    this.camera.far = 50 * radius;
    this.camera.updateProjectionMatrix();
    this.controls?.dispose(); // they take over the camera's upward direction when they are made
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.controls.target.copy(center);
    this.controls.update();
    this.controls.addEventListener("change", () => this.draw());
    this.draw();
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.stage;
    if (!width || !height) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  /** Casts rays from the eye through the place of a pointer. */
  rayAt(event) {
    const box = this.canvas.getBoundingClientRect(), found = new THREE.Raycaster();
    const at = new THREE.Vector2(
      2 * (event.clientX - box.left) / box.width - 1, 1 - 2 * (event.clientY - box.top) / box.height,
    );
    found.setFromCamera(at, this.camera);
    return found;
  }

  render() { this.renderer.render(this.scene, this.camera); }
}

/** The look of a body: its colour, or those of its vertices (sRGB, uint8), which its geometry then gets. */
export function looks(geometry, { colour, opacity }, srgb) {
  if (srgb) {
    const linear = new Float32Array(srgb.length), one = new THREE.Color();
    for (let i = 0; i < srgb.length; i += 3) {
      one.setRGB(srgb[i] / 255, srgb[i + 1] / 255, srgb[i + 2] / 255, THREE.SRGBColorSpace).toArray(linear, i);
    }
    geometry.setAttribute("color", new THREE.BufferAttribute(linear, 3));
  }
  return new THREE.MeshStandardMaterial({
    color: srgb ? 0xffffff : new THREE.Color().setRGB(...colour, THREE.SRGBColorSpace),
    vertexColors: Boolean(srgb), roughness: 0.6, side: THREE.DoubleSide, transparent: opacity < 1, opacity,
  });
}

/** Meshes of a geometry; of a translucent one its depth first, so that only the foremost sheet blends. */
export function meshesOf(geometry, material, order) {
  const mesh = new THREE.Mesh(geometry, material);
  mesh.renderOrder = 2 * order + 1;
  if (!material.transparent) return [mesh];
  const first = { colorWrite: false, side: THREE.DoubleSide, transparent: true };
  const depth = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial(first));
  depth.renderOrder = 2 * order;
  return [depth, mesh];
}
