"""From a clip to poses: frames, masks, camera and sizes, joint positions in every frame."""
