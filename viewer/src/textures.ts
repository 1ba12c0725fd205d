// Materials with the scene's textures, which come when they have been fetched.

import * as THREE from "three";
import type { Texture, Wrap } from "./protocol.js";

const WRAPS: Record<Wrap, THREE.Wrapping> = {
  Repeat: THREE.RepeatWrapping,
  Mirror: THREE.MirroredRepeatWrapping,
  Clamp: THREE.ClampToEdgeWrapping,
};

/** Textured kin of a material: they share its values, but for those of their texture. */
export class Textures {
  private readonly materials = new Map<string, THREE.RawShaderMaterial>();
  private readonly images = new Map<number, Promise<ImageBitmap>>();

  /** `changed` is called when there is more to be seen. */
  constructor(
    private readonly plain: THREE.RawShaderMaterial,
    private readonly changed: () => void,
  ) {}

  /** The material of a texture. */
  material(texture: Texture): THREE.RawShaderMaterial {
    const key = JSON.stringify(texture);
    let material = this.materials.get(key);
    if (!material) {
      material = this.make(texture);
      this.materials.set(key, material);
    }
    return material;
  }

  /** Forgets all: another scene comes. */
  clear(): void {
    for (const material of this.materials.values()) {
      (material.uniforms.texels!.value as THREE.Texture | null)?.dispose();
      material.dispose();
    }
    this.materials.clear();
    this.images.clear();
  }

  private make({ image, wrap, nearest, factor, cutoff }: Texture): THREE.RawShaderMaterial {
    const material = this.plain.clone();
    const texels = { value: null as THREE.Texture | null };
    const uniforms = { texels, factor: { value: new THREE.Vector3(...factor) }, cutoff: { value: cutoff } };
    material.uniforms = { ...this.plain.uniforms, ...uniforms };
    Object.assign(material.defaultAttributeValues, this.plain.defaultAttributeValues);
    void this.fetch(image).then((bitmap) => {
      const texture = new THREE.Texture(bitmap);
      // Rows come as they are, the first one at v = 0.
      texture.flipY = false;
      texture.colorSpace = THREE.SRGBColorSpace;
      [texture.wrapS, texture.wrapT] = [WRAPS[wrap[0]], WRAPS[wrap[1]]];
      if (nearest) texture.magFilter = THREE.NearestFilter;
      texture.anisotropy = 4;
      texture.needsUpdate = true;
      texels.value = texture;
      material.defines = { TEXTURED: "" };
      material.needsUpdate = true;
      this.changed();
    }, console.warn);
    return material;
  }

  private fetch(image: number): Promise<ImageBitmap> {
    let found = this.images.get(image);
    if (!found) {
      found = fetch(`image/${image}${location.search}`)
        .then((response) => (response.ok ? response.blob() : Promise.reject(new Error(`image ${image}`))))
        .then((blob) => createImageBitmap(blob, { premultiplyAlpha: "none", colorSpaceConversion: "none" }));
      this.images.set(image, found);
    }
    return found;
  }
}
